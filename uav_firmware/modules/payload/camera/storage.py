"""How much of the storage the pictures take."""

from typing import Final

MIB: Final = 1 << 20
JPEG_BYTES_PER_PIXEL: Final = 0.4
"""[B/px] Of a fine JPEG. Pictures that no device stores are reckoned with it."""


class Storage:
    """A card of `total_mib` [MiB] that fills picture by picture."""

    def __init__(self, total_mib: float) -> None:
        self.total_mib = total_mib
        self.used_mib = 0.0

    def has_room(self, size_bytes: float) -> bool:
        """Whether a file of this size [B] fits."""
        return self.used_mib + size_bytes / MIB <= self.total_mib

    def add(self, size_bytes: float) -> None:
        """Take up room [B]."""
        self.used_mib += size_bytes / MIB

    def remove(self, size_bytes: float) -> None:
        """Give back room [B]."""
        self.used_mib = max(0.0, self.used_mib - size_bytes / MIB)

    def format(self) -> None:
        """Give all room back."""
        self.used_mib = 0.0
