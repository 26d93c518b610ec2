"""Makes thumbnails, one at a time, and keeps the latest of them.

Few requests wait for their turn: a gallery asks for many pictures at once, and every waiting one
holds a thread that an abort may need.
"""

import subprocess
import sys
import threading
from collections import OrderedDict
from pathlib import Path
from typing import Final

SIDE_PX: Final = 320
LARGEST_MEGAPIXELS: Final = 100
"""Of the picture, by its header."""
TIMEOUT_S: Final = 20.0
PATIENCE_S: Final = 5.0
WAITING: Final = 3
"""Requests that may wait for their turn."""
KEPT_BYTES: Final = 2 * 1024 * 1024
_PROGRAM: Final = Path(__file__).with_name("reduce.py")
"""Not imported: it loads the library that reads pictures."""
_REASON_CHARACTERS: Final = 200


class UnreadableError(Exception):
    """A picture that cannot be made smaller; the text says why."""


class BusyError(Exception):
    """Too many pictures wait; a later request may succeed."""


class Thumbnails:
    """Thumbnails by the key of their picture; for many threads."""

    def __init__(self) -> None:
        self._turn = threading.Lock()
        self._places = threading.BoundedSemaphore(1 + WAITING)
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._guard = threading.Lock()

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
        with self._guard:
            if key in self._kept:
                self._kept.move_to_end(key)
            return self._kept.get(key)

    def _keep(self, key: str, made: bytes) -> None:
        with self._guard:
            self._kept[key] = made
            while sum(map(len, self._kept.values())) > KEPT_BYTES:
                self._kept.popitem(last=False)


def _reduce(data: bytes) -> bytes:
    sizes = (str(SIDE_PX), str(LARGEST_MEGAPIXELS))
    try:
        done = subprocess.run(  # noqa: S603  # our own program, and no shell
            [sys.executable, "-I", str(_PROGRAM), *sizes],
            input=data,
            capture_output=True,
            timeout=TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise UnreadableError("reading it takes too long") from None
    except OSError as error:
        raise BusyError(f"pictures cannot be read now: {error}") from error
    if done.returncode != 0 or not done.stdout:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        reason = lines[-1][:_REASON_CHARACTERS] if lines else f"status {done.returncode}"
        raise UnreadableError(reason)
    return done.stdout
