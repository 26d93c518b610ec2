"""Pictures for the map of GeoTIFFs: made once, one at a time, and kept in a folder."""

import contextlib
import json
import threading
from pathlib import Path
from typing import Final

from edge_server.pictures import index_colours, program
from edge_server.pictures.program import BusyError

SIDE_PX: Final = 4096
"""The largest texture that every phone can draw."""
LARGEST_MEGAPIXELS: Final = 100
TIMEOUT_S: Final = 90.0
KEPT: Final = 60
SUFFIX: Final = ".webp"


class Orthophotos:
    """Pictures by the key of their file; for many threads."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._turn = threading.Lock()

    def of(self, key: str, path: Path) -> bytes:
        """Give the picture of a file as a WebP.

        Raises:
            UnreadableError: if it cannot be read.
            BusyError: if another one is being made.
        """
        kept = self._folder / f"{key}{SUFFIX}"
        with contextlib.suppress(OSError):
            return kept.read_bytes()
        if not self._turn.acquire(blocking=False):
            raise BusyError("another map is being prepared")
        try:
            colours = json.dumps(index_colours.colours_of_unit())
            arguments = (str(path.absolute()), str(SIDE_PX), str(LARGEST_MEGAPIXELS), colours)
            made = program.run("orthophoto", *arguments, within_s=TIMEOUT_S)
            with contextlib.suppress(OSError):  # Without room on the disk it is made again
                self._keep(kept, made)
        finally:
            self._turn.release()
        return made

    def _keep(self, path: Path, made: bytes) -> None:
        self._folder.mkdir(exist_ok=True)
        old = sorted(self._folder.glob(f"*{SUFFIX}"), key=lambda one: one.stat().st_mtime)
        for one in old[: -KEPT + 1]:
            one.unlink(missing_ok=True)
        unfinished = path.with_suffix(".part")
        unfinished.write_bytes(made)
        unfinished.replace(path)
