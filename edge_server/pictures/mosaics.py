"""Has the maps of surveys made: one at a time, by a program beside the server, with a deadline."""

import json
import logging
import struct
import subprocess
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from afarcloud.plan import Vertex
from edge_server.pictures.program import BusyError, UnreadableError

LOG = logging.getLogger(__name__)
LONGEST_SIDE_PX: Final = 2400
LARGEST_MEGAPIXELS: Final = 100
MOST_PICTURES: Final = 400
TIMEOUT_S: Final = 900.0
_FAILURES_KEPT: Final = 100
_REASON_CHARACTERS: Final = 200


class MapKey(NamedTuple):
    """Which map: of which flight, and of its pictures of which band."""

    flight_id: int
    band: str


class Mosaic(NamedTuple):
    """A map: a WebP, and what it shows as `mosaic.py` describes it."""

    data: bytes
    about: dict[str, Any]


def lay_out(
    footprints: Sequence[Sequence[Vertex]],
    read: Callable[[int], bytes],
    *,
    colours: Sequence[tuple[int, int, int, int]] | None = None,
) -> Mosaic:
    """Lay pictures out as one map; `read` gives a picture by its index, one after the other.

    `colours` are red, green, blue and opacity of the 256 grey values of grey pictures.

    Raises:
        UnreadableError: if no map can be made of them, or not in time.
        BusyError: if the program cannot be started.
    """
    program = Path(__file__).with_name("mosaic.py")
    command = [sys.executable, "-I", str(program), str(LONGEST_SIDE_PX), str(LARGEST_MEGAPIXELS)]
    pipe = subprocess.PIPE
    try:
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe)  # noqa: S603  # our own program, and no shell
    except OSError as error:
        raise BusyError(f"the map cannot be made now: {error}") from error
    deadline = threading.Timer(TIMEOUT_S, process.kill)
    deadline.daemon = True
    deadline.start()
    try:
        with suppress(BrokenPipeError):  # It has ended: its reason follows
            assert process.stdin is not None  # noqa: S101  # it is a pipe
            header = {"footprints": footprints, "colours": colours}
            process.stdin.write(json.dumps(header).encode() + b"\n")
            for index in range(len(footprints)):
                data = read(index)
                process.stdin.write(struct.pack(">Q", len(data)) + data)
        out, errors = process.communicate()
    finally:
        deadline.cancel()
        process.kill()
        process.wait()
    if process.returncode != 0:
        lines = errors.decode("utf-8", "replace").strip().splitlines()
        reason = lines[-1] if lines else f"its program has ended with {process.returncode}"
        raise UnreadableError(reason[:_REASON_CHARACTERS])
    about, _, data = out.partition(b"\n")
    return Mosaic(data, json.loads(about))


class MosaicWork:
    """Which map is being made, and why others could not be; for many threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._present: MapKey | None = None
        self._failures: OrderedDict[MapKey, str] = OrderedDict()

    def is_making(self, key: MapKey) -> bool:
        """Whether this map is being made now."""
        return self._present == key

    def failure(self, key: MapKey) -> str | None:
        """Why this map could not be made the last time."""
        return self._failures.get(key)

    def begin(self, key: MapKey, make: Callable[[], None]) -> None:
        """Make a map in a thread of its own; `make` raises Exception where that fails.

        Raises:
            BusyError: while another one is made.
        """
        with self._lock:
            if self._present is not None:
                raise BusyError("another map is being made; try again when it is done")
            self._present = key
            self._failures.pop(key, None)
        thread = threading.Thread(target=self._run, args=(key, make), name="map")
        thread.daemon = True
        thread.start()

    def _run(self, key: MapKey, make: Callable[[], None]) -> None:
        try:
            make()
        except Exception as error:  # noqa: BLE001  # whatever it is, it is shown with the flight
            LOG.warning(
                "the %s map of flight %d could not be made: %s", key.band, key.flight_id, error
            )
            self._failures[key] = str(error) or type(error).__name__
            while len(self._failures) > _FAILURES_KEPT:
                self._failures.popitem(last=False)
        finally:
            self._present = None
