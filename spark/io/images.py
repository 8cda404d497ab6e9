"""Pictures in files of others (PNG, JPEG, WebP), made small, by Pillow."""

from io import BytesIO

import numpy as np
from jaxtyping import UInt8

from spark.errors import DependencyError

_MAX_PIXELS = 1 << 26  # of a stranger's file; 8192 x 8192
_UNREADABLE = (OSError, ValueError, SyntaxError, EOFError, MemoryError)


def picture(content: bytes, *, side: int) -> UInt8[np.ndarray, "H W 4"]:
    """A picture with transparency, at most `side` pixels wide and high. Raises `ValueError` where
    it can't be read, `DependencyError` without Pillow."""
    try:
        from PIL import Image
    except ImportError as error:
        raise DependencyError("pictures need Pillow: pip install 'spark-sim[video]'") from error
    try:
        with Image.open(BytesIO(content), formats=("PNG", "JPEG", "WEBP")) as found:
            if found.width * found.height > _MAX_PIXELS:
                raise ValueError(f"{found.width} x {found.height} pixels")
            found.draft("RGB", (side, side))
            image = found.convert("RGBA")
    except (*_UNREADABLE, Image.DecompressionBombError) as error:
        raise ValueError(str(error) or type(error).__name__) from error
    image.thumbnail((side, side), Image.Resampling.BOX)
    return np.array(image)
