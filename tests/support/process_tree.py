"""Processes and what they have started, read from /proc; a pipe whose reader has stalled."""

import os
import re
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path


def descendants(process_id: int) -> list[int]:
    """Living processes that a process has started, and those that they have started."""
    parents: dict[int, int] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        fields = _status(int(folder.name))
        if fields is not None:
            parents[int(folder.name)] = int(fields[1])
    return _below(process_id, parents)


def command_words(process_id: int) -> list[str]:
    """Words of a process's command line, or of the title that it has given itself."""
    try:
        line = Path(f"/proc/{process_id}/cmdline").read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return []
    return re.split(r"[\0 \[\]]+", line)


def gone(process_ids: Iterable[int], within_s: float) -> bool:
    """Whether none of these lives any more, at the latest after `within_s`."""
    waited_for = list(process_ids)
    deadline = time.monotonic() + within_s
    while any(_status(one) is not None for one in waited_for):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def _below(process_id: int, parents: dict[int, int]) -> list[int]:
    children = [child for child, parent in parents.items() if parent == process_id]
    return children + [below for child in children for below in _below(child, parents)]


def _status(process_id: int) -> list[str] | None:
    """State, parent and so on of a living process (proc(5)); a zombie does not live."""
    try:
        text = Path(f"/proc/{process_id}/stat").read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return None
    fields = text.rpartition(")")[2].split()
    return None if fields[0] in "ZX" else fields


def full_pipe() -> tuple[int, int]:
    """Make a pipe that has no room; gives its ends for reading and for writing."""
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)
    with suppress(BlockingIOError):
        while True:
            os.write(write_end, b"\n")
    os.set_blocking(write_end, True)
    return read_end, write_end
