"""Lines from a file instead of a person.

A line is what would be typed. `# ...` is passed over, `@wait 2` waits two seconds, and behind
`@auto 0.5` everything is answered by itself: half a second, then '1' to finish a command, '0' to
land after an abort or an alarm.

ScriptError  a line that is none of these
"""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

from sim.tester.terminal.screens import Place

_KINDS: Final = ("@wait", "@auto")
_AUTOMATIC: Final = {Place.MAIN: "1", Place.LANDING: "0"}


class ScriptError(Exception):
    """A line that cannot be read, with its number."""


@dataclass(frozen=True, slots=True)
class _Wait:
    seconds: float


@dataclass(frozen=True, slots=True)
class _Automatic:
    seconds: float


_Entry: TypeAlias = str | _Wait | _Automatic


class Script:
    """What is still to be typed."""

    def __init__(self, lines: Iterable[str]) -> None:
        """Read a script.

        Raises:
            ScriptError: naming the line.
        """
        numbered = enumerate(lines, start=1)
        self._entries = deque(
            _entry(line.rstrip("\r\n"), n) for n, line in numbered if not line.startswith("#")
        )
        self._free_at = -math.inf
        self._asked: Place | None = None

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return not self._entries

    def next_line(self, place: Place, now: float) -> str | None:
        """Give the line that is due where a line is waited for; None while none is."""
        while self._entries:
            entry = self._entries[0]
            match entry:
                case _Wait(seconds):
                    self._entries.popleft()
                    self._free_at = max(now, self._free_at) + seconds
                case _Automatic(seconds):
                    return self._automatic(place, seconds, now)
                case str():
                    if now < self._free_at:
                        return None
                    self._entries.popleft()
                    return entry
        return None

    def _automatic(self, place: Place, seconds: float, now: float) -> str | None:
        if place is not self._asked:
            self._asked, self._free_at = place, max(now + seconds, self._free_at)
        if now < self._free_at or place not in _AUTOMATIC:
            return None
        self._asked = None
        return _AUTOMATIC[place]


def _entry(line: str, number: int) -> _Entry:
    if not line.startswith("@"):
        return line
    kind, _, value = line.partition(" ")
    try:
        seconds = float(value)
    except ValueError:
        kind = ""
    if kind not in _KINDS:
        raise ScriptError(f"line {number}: {line!r} is neither @wait nor @auto seconds")
    if not 0.0 <= seconds <= 86_400.0:
        raise ScriptError(f"line {number}: seconds are 0 to 86400, not {value}")
    return _Wait(seconds) if kind == "@wait" else _Automatic(seconds)
