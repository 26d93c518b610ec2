"""The keys of the vehicles' links: one file per MAVLink system, readable by its owner only."""

import logging
import os
import re
import stat
from pathlib import Path
from typing import Final

KEY_LENGTH: Final = 32
LOOK_AGAIN_S: Final = 5.0
"""How often a key that is not there is looked for."""

_FILE_NAME: Final = re.compile(r"signing-([1-9][0-9]{0,2})\.key")

_LOG = logging.getLogger(__name__)


class KeyRing:
    """Keys by system id, read when first needed; a key that is missing may still come."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._keys: dict[int, bytes] = {}
        self._missing: dict[int, float] = {}

    def key_of(self, system: int, now: float) -> bytes | None:
        """Key of a system; None where there is no file that holds one."""
        if system not in self._keys and now >= self._missing.get(system, now):
            key = self._read(system)
            if key is None:
                self._missing[system] = now + LOOK_AGAIN_S
            else:
                self._keys[system] = key
        return self._keys.get(system)

    def systems(self) -> list[int]:
        """Systems that have a file in the folder, usable or not."""
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
                is_open = stat.S_IMODE(os.fstat(file.fileno()).st_mode) & 0o077
                contents = file.read(4 * KEY_LENGTH)
            key = contents if len(contents) == KEY_LENGTH else bytes.fromhex(contents.decode())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            _LOG.warning("%s cannot be used: %s", path, error)
            return None
        if is_open:
            _LOG.warning("%s cannot be used: others may read it", path)
            return None
        if len(key) != KEY_LENGTH or not any(key):
            _LOG.warning("%s holds no key of %d bytes", path, KEY_LENGTH)
            return None
        return key
