"""The log of captures: numbers each picture once, and knows a repeated command.

MAVLink's image_count and image_index: the newest picture has index image_count - 1, and both
begin anew when the storage is formatted or the log is reset.
"""

from typing import Final

from uav_firmware.msg.payload import Controller

REPEAT_LIMIT_US: Final = 10_000_000
"""[us] A client that starts again counts from 1 again, so that old numbers must be forgotten."""


class CaptureLedger:
    """Counts pictures and remembers the newest sequence number of each sender."""

    def __init__(self) -> None:
        self.count = 0
        self._sequences: dict[Controller, tuple[int, int]] = {}

    def next_index(self) -> int:
        """Index of the next picture, which counts from now on."""
        self.count += 1
        return self.count - 1

    def reset(self) -> None:
        """Begin anew at index 0."""
        self.count = 0
        self._sequences.clear()

    def is_repeated(self, sender: Controller, sequence: int, now_us: int) -> bool:
        """Whether a single-shot command with this number was just carried out; 0 never was."""
        known = self._sequences.get(sender)
        return (
            sequence > 0
            and known is not None
            and known[0] == sequence
            and now_us - known[1] <= REPEAT_LIMIT_US
        )

    def note(self, sender: Controller, sequence: int, now_us: int) -> None:
        """Remember the number of a single-shot command that is carried out."""
        if sequence > 0:
            self._sequences[sender] = (sequence, now_us)
