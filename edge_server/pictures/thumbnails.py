"""Makes thumbnails, one at a time, and keeps the latest of them.

Few requests wait for their turn: a gallery asks for many pictures at once, and every waiting one
holds a thread that an abort may need.
"""

import threading
from collections import OrderedDict
from typing import Final

from edge_server.pictures import program
from edge_server.pictures.program import BusyError

SIDE_PX: Final = 320
LARGEST_MEGAPIXELS: Final = 100
"""Of the picture, by its header."""
TIMEOUT_S: Final = 20.0
PATIENCE_S: Final = 5.0
WAITING: Final = 3
"""Requests that may wait for their turn."""
KEPT_BYTES: Final = 2 * 1024 * 1024


class Thumbnails:
    """Thumbnails by the key of their picture; for many threads."""

    def __init__(self) -> None:
        self._turn = threading.Lock()
        self._places = threading.BoundedSemaphore(1 + WAITING)
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, key: str, data: bytes) -> bytes:
        """Give the thumbnail of a picture as a JPEG.

        Raises:
            UnreadableError: if it is no picture, damaged or too large.
            BusyError: if others take too long.
        """
        if (known := self._find(key)) is not None:
            return known
        if not self._places.acquire(blocking=False):
            raise BusyError("too many pictures are wanted at once")
        try:
            if not self._turn.acquire(timeout=PATIENCE_S):
                raise BusyError("another picture takes long")
            try:
                made = self._find(key) or _reduce(data)
            finally:
                self._turn.release()
        finally:
            self._places.release()
        self._keep(key, made)
        return made

    def _find(self, key: str) -> bytes | None:
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
            return self._kept.get(key)

    def _keep(self, key: str, made: bytes) -> None:
        with self._lock:
            self._kept[key] = made
            while sum(map(len, self._kept.values())) > KEPT_BYTES:
                self._kept.popitem(last=False)


def _reduce(data: bytes) -> bytes:
    sizes = (str(SIDE_PX), str(LARGEST_MEGAPIXELS))
    return program.run("reduce", *sizes, data=data, within_s=TIMEOUT_S)
