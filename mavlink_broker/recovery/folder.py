"""The pages in a folder: each a file that is the old one or the new one, never half of either.

A page is written beside the old one, brought onto the disk, and put into its place; then the
folder is brought onto the disk too. What is no page is set aside under `.bad`, and said so.
"""

import logging
import os
import stat
from pathlib import Path
from typing import Final

from mavlink_broker.recovery.encoding import LARGEST_BYTES, PageError, decode, encode
from mavlink_broker.recovery.record import NOTHING, Memo, Owner

MOST_PAGES: Final = 1000
"""That are read; each system id may have several vehicles."""
_PREFIX: Final = "vehicle-"
_SUFFIX: Final = ".json"

_LOG = logging.getLogger(__name__)


class JournalFolder:
    """All pages of one broker."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @property
    def path(self) -> Path:
        """Where they are."""
        return self._folder

    def read_all(self) -> dict[Owner, Memo]:
        """Read every page; what is none is set aside, what cannot be read is told."""
        try:
            names = sorted(
                path.name
                for path in self._folder.iterdir()
                if path.name.startswith(_PREFIX) and path.name.endswith(_SUFFIX)
            )
        except FileNotFoundError:
            return {}
        except OSError as error:
            _LOG.warning("the journal cannot be read: %s: %s", self._folder, error.strerror)
            return {}
        if len(names) > MOST_PAGES:
            _LOG.warning("%s holds %d pages: %d are read", self._folder, len(names), MOST_PAGES)
        pages = (self._read(name) for name in names[:MOST_PAGES])
        return dict(filter(None, pages))

    def write(self, owner: Owner, memo: Memo) -> None:
        """Replace the page of a vehicle; an empty one is removed.

        Raises:
            OSError: if the disk refuses; the page is the old one or the new one.
            PageError: if it cannot be written down; the page is the old one.
        """
        path = self._folder / _name(owner)
        if memo == NOTHING:
            path.unlink(missing_ok=True)
            if self._folder.is_dir():
                self._sync_folder()
            return
        data = encode(owner, memo)
        self._folder.mkdir(parents=True, exist_ok=True)
        beside = path.with_suffix(".tmp")
        descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
        self._sync_folder()

    def _sync_folder(self) -> None:
        descriptor = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def _read(self, name: str) -> tuple[Owner, Memo] | None:
        path = self._folder / name
        try:
            owner, memo = decode(_content(path))
        except OSError as error:
            _LOG.warning("%s cannot be read: %s", path, error.strerror)
            return None
        except PageError as error:
            self._set_aside(path, str(error))
            return None
        if _name(owner) == name:
            return owner, memo
        self._set_aside(path, f"it is the page of {owner}")
        return None

    def _set_aside(self, path: Path, reason: str) -> None:
        aside = path.with_suffix(".bad")
        try:
            path.replace(aside)
        except OSError as error:
            _LOG.warning("%s is not believed: %s; it stays: %s", path, reason, error.strerror)
        else:
            _LOG.warning("%s is not believed: %s; it is %s now", path, reason, aside.name)


def _name(owner: Owner) -> str:
    mark = f"-{owner.uid}" if owner.uid else ""
    return f"{_PREFIX}{owner.system}{mark}{_SUFFIX}"


def _content(path: Path) -> bytes:
    """Read a plain file of a sensible size; anything else is no page.

    Raises:
        OSError: if it cannot be read.
        PageError: if it is no plain file, or too large.
    """
    if not stat.S_ISREG(path.lstat().st_mode):
        raise PageError("it is no plain file")
    with path.open("rb") as file:
        data = file.read(LARGEST_BYTES + 1)
    if len(data) > LARGEST_BYTES:
        raise PageError(f"it is larger than {LARGEST_BYTES} bytes")
    return data
