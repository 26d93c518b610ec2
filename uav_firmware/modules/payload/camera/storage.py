"""Free space of the camera's storage, and the log of captures."""

from typing import Final

from uav_firmware.msg.payload import Controller

MIB: Final = 1 << 20
JPEG_BYTES_PER_PIXEL: Final = 0.4
"""[B/px] Estimate for a JPEG of high quality."""
REPEAT_LIMIT_US: Final = 10_000_000
"""[us] Sequence numbers expire after this time: a restarted client counts from 1 again."""


class Storage:
    """Storage of `total_mib` [MiB]."""

    def __init__(self, total_mib: float) -> None:
        self.total_mib = total_mib
        self.used_mib = 0.0

    def has_space(self, size_bytes: float) -> bool:
        """Whether a file of this size [B] fits."""
        return self.used_mib + size_bytes / MIB <= self.total_mib

    def add(self, size_bytes: float) -> None:
        """Add to the used space [B]."""
        self.used_mib += size_bytes / MIB

    def remove(self, size_bytes: float) -> None:
        """Subtract from the used space [B]."""
        self.used_mib = max(0.0, self.used_mib - size_bytes / MIB)

    def format(self) -> None:
        """Free all space."""
        self.used_mib = 0.0


class CaptureLog:
    """Numbers pictures and stores the newest sequence number of each sender.

    MAVLink's image_count and image_index: the newest picture has index image_count - 1, and both
    restart at 0 when the storage is formatted or the log is reset. Second pictures, which a camera
    stores beside the first ones while a parameter says so, have numbers of their own.
    """

    def __init__(self) -> None:
        self.count = 0
        self.second_count = 0
        self._sequences: dict[Controller, tuple[int, int]] = {}

    def next_index(self) -> int:
        """Count a picture and return its index."""
        self.count += 1
        return self.count - 1

    def next_second_index(self) -> int:
        """Count a second picture and return its index."""
        self.second_count += 1
        return self.second_count - 1

    def reset(self) -> None:
        """Restart at index 0."""
        self.count = self.second_count = 0
        self._sequences.clear()

    def is_repeated(self, sender: Controller, sequence: int, now_us: int) -> bool:
        """Whether a single-shot command with this number was executed recently; never for 0."""
        known = self._sequences.get(sender)
        return (
            sequence > 0
            and known is not None
            and known[0] == sequence
            and now_us - known[1] <= REPEAT_LIMIT_US
        )

    def note(self, sender: Controller, sequence: int, now_us: int) -> None:
        """Store the number of a single-shot command that is executed."""
        if sequence > 0:
            self._sequences[sender] = (sequence, now_us)
