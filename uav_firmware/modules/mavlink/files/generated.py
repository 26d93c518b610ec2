"""Files that are made when they are opened: a store of which nothing can be changed."""

import errno
import os

from uav_firmware.cal.files import Place


def refusal(code: int) -> OSError:
    """The OSError of an error number, with its sentence."""
    return OSError(code, os.strerror(code))


class FixedStore:
    """The part of `uav_firmware.cal.files.FileStore` that changes names: all of it refused."""

    def truncate(self, place: Place, size: int) -> None:
        """Refused."""
        del place, size
        raise refusal(errno.EACCES)

    def remove(self, place: Place) -> None:
        """Refused."""
        del place
        raise refusal(errno.EACCES)

    def make_folder(self, place: Place) -> None:
        """Refused."""
        del place
        raise refusal(errno.EACCES)

    def remove_folder(self, place: Place) -> None:
        """Refused."""
        del place
        raise refusal(errno.EACCES)

    def rename(self, place: Place, new_place: Place) -> None:
        """Refused."""
        del place, new_place
        raise refusal(errno.EACCES)


class GeneratedFile:
    """Implements `uav_firmware.cal.files.OpenFile` on bytes that do not change."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    @property
    def size(self) -> int:
        """Length [bytes]."""
        return len(self._data)

    def read(self, offset: int, count: int) -> bytes:
        """At most `count` bytes from `offset`."""
        return self._data[offset : offset + count]

    def write(self, offset: int, chunk: bytes) -> None:
        """Refused."""
        del offset, chunk
        raise refusal(errno.EACCES)

    def close(self) -> None:
        """Nothing to release."""

    def abandon(self) -> None:
        """Nothing to release."""
