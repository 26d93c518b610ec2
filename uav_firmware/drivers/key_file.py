"""A secret key in a file that only its owner can read."""

import os
import stat
from pathlib import Path
from typing import Final

KEY_LENGTH: Final = 32
_LONGEST: Final = 4 * KEY_LENGTH


class KeyFileError(ValueError):
    """The file contains no key, or others may read it; the message names the file."""


def read_key(path: Path) -> bytes:
    """Read 32 bytes, raw or as 64 hexadecimal digits with white space around them.

    Raises:
        KeyFileError: if others may read the file, or it contains something else, or only zeros.
        OSError: if it cannot be read.
    """
    with path.open("rb") as file:
        mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
        contents = file.read(_LONGEST)
    if mode & 0o077:
        raise KeyFileError(f"{path}: others may read it (mode {mode:04o}); chmod 600 it")
    key = contents if len(contents) == KEY_LENGTH else _from_hex(contents)
    if len(key) != KEY_LENGTH or not any(key):
        raise KeyFileError(f"{path}: holds neither {KEY_LENGTH} bytes nor {2 * KEY_LENGTH} digits")
    return key


def _from_hex(contents: bytes) -> bytes:
    """Bytes of hexadecimal digits; empty for anything else."""
    try:
        return bytes.fromhex(contents.decode("ascii"))
    except ValueError:
        return b""
