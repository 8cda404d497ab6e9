"""Pictures as files and pages hold them, by Pillow."""

import base64
from io import BytesIO
from typing import Any

import numpy as np
from jaxtyping import UInt8

from spark.errors import DependencyError


def pillow() -> Any:
    """Pillow's Image."""
    try:
        from PIL import Image
    except ImportError as error:
        raise DependencyError("pictures need Pillow: pip install 'spark-sim[video]'") from error
    return Image


def jpeg(picture: UInt8[np.ndarray, "H W 3"], *, quality: int, side: int | None = None) -> str:
    """A JPEG in base64, neither wider nor higher than `side` [pixels]."""
    image = pillow().fromarray(picture)
    if side is not None:
        image.thumbnail((side, side))
    buffer = BytesIO()
    image.save(buffer, format="JPEG", quality=quality)
    return base64.b64encode(buffer.getvalue()).decode()
