"""Signing keys: one file per MAVLink system, readable by its owner only."""

import logging
import os
import re
import stat
from pathlib import Path
from typing import Final

KEY_LENGTH: Final = 32
RETRY_INTERVAL_S: Final = 5.0
"""Interval at which a missing key file is read again."""

_FILE_NAME: Final = re.compile(r"signing-([1-9][0-9]{0,2})\.key")

_LOG = logging.getLogger(__name__)


class KeyRing:
    """Keys by system id, read when first needed; a missing file may appear later."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._keys: dict[int, bytes] = {}
        self._missing: dict[int, float] = {}

    def key_of(self, system: int, now: float) -> bytes | None:
        """Key of a system; None without a valid key file."""
        if system not in self._keys and now >= self._missing.get(system, now):
            key = self._read(system)
            if key is None:
                self._missing[system] = now + RETRY_INTERVAL_S
            else:
                self._keys[system] = key
        return self._keys.get(system)

    def systems(self) -> list[int]:
        """Systems that have a key file in the folder, valid or not."""
        try:
            names = [path.name for path in self.folder.iterdir()]
        except OSError:
            return []
        found = (_FILE_NAME.fullmatch(name) for name in names)
        return sorted(int(match[1]) for match in found if match and int(match[1]) <= 255)

    def _read(self, system: int) -> bytes | None:
        path = self.folder / f"signing-{system}.key"
        try:
            with path.open("rb") as file:
                accepts_unsigned = stat.S_IMODE(os.fstat(file.fileno()).st_mode) & 0o077
                contents = file.read(4 * KEY_LENGTH)
            key = contents if len(contents) == KEY_LENGTH else bytes.fromhex(contents.decode())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            _LOG.warning("%s cannot be used: %s", path, error)
            return None
        if accepts_unsigned:
            _LOG.warning("%s cannot be used: others may read it; set its mode to 600", path)
            return None
        if len(key) != KEY_LENGTH or not any(key):
            _LOG.warning("%s does not contain a key of %d bytes", path, KEY_LENGTH)
            return None
        return key
