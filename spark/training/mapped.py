"""Arrays that lie in a file, for several processes: each maps the file, and none copies it."""

import mmap
from typing import Any

import numpy as np


class MappedArray(np.memmap[Any, Any]):
    """A mapped array, or a part of one. Pickled, it is the place in the file."""

    def __reduce__(self) -> Any:
        memory = getattr(self, "_mmap", None)
        if memory is None or not self.flags["C_CONTIGUOUS"]:  # the result of an operation
            return np.array, (np.array(self),)
        begin = np.frombuffer(memory, np.uint8).__array_interface__["data"][0]
        # What is mapped begins at a whole page of the file.
        page = self.offset - self.offset % mmap.ALLOCATIONGRANULARITY
        at = page + self.__array_interface__["data"][0] - begin
        return _map, (str(self.filename), self.dtype.str, at, self.shape)


def _map(path: str, dtype: str, at: int, shape: tuple[int, ...]) -> MappedArray:
    return np.memmap(path, np.dtype(dtype), "r", at, shape).view(MappedArray)
