"""Files with secrets: the first keys on their way to those who use them, and those of others.

`STATE_DIR/keys/<role>.key` is written once, with mode 0600. An operator may take it away; its key
stays valid, and `keys rotate` makes a new one and revokes the old.

A secret that others can read is none. What we have made ourselves is closed again, with a warning;
a file that was given to us (a TLS key, say) is refused, because only who gave it knows who has
read it.

OpenSecretError  a secret that was given to us cannot be used, or can be read by others
"""

import logging
import os
import stat
from pathlib import Path
from typing import Final

from edge_server.config import Config
from edge_server.services import audit
from edge_server.services import keys as service
from edge_server.store import keys
from edge_server.store.database import Database
from edge_server.store.keys import Role
from edge_server.store.locks import KEYS

LOG = logging.getLogger(__name__)
_OTHERS: Final = 0o077
_ROOTS_OTHERS: Final = 0o037
"""A secret of root's may be readable by the group that we run as, as Debian keeps its TLS keys."""


class OpenSecretError(Exception):
    """A secret that was given to us cannot be used, or can be read by others."""


def path_of(keys_dir: Path, role: Role) -> Path:
    """Where a role's key lies."""
    return keys_dir / f"{role.value}.key"


def ensure(database: Database, keys_dir: Path, now: float) -> None:
    """Make what is missing: a key per role, or in a new database the keys that lie there."""
    keys_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    with database.write(KEYS) as connection:
        have_key = {key.role for key in keys.active(connection) if key.in_file}
        for role in Role:
            path = path_of(keys_dir, role)
            close(path)
            key = read(path)
            if key is None and path.exists():
                LOG.error("%s holds no access key; remove it or rotate the key", path)
            elif key is not None:
                keys.add(connection, _filed(key, role, now))
            elif role.value not in have_key:
                key = keys.generate()
                keys.add(connection, _filed(key, role, now))
                write(path, key)


def rotate(
    database: Database, keys_dir: Path, role: Role, now: float, overlap_s: float = 0.0
) -> Path:
    """Make a new key for a role's file; the old one opens for `overlap_s` [s] more.

    Keys of the same role that lie in no file stay as they are. Returns the file.
    """
    path = path_of(keys_dir, role)
    keys_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    key = keys.generate()
    with database.write(KEYS) as connection:
        for old in keys.active(connection):
            if old.in_file and old.role == role:
                service.retire(connection, old, overlap_s, now)
        made = _filed(key, role, now)
        keys.add(connection, made)
        audit.about(f"keys/{made.prefix}")
        write(path, key)
    return path


def _filed(key: str, role: Role, now: float) -> keys.StoredKey:
    return keys.made_from(key, role, role.value, now)._replace(in_file=True)


def read(path: Path) -> str | None:
    """Read a key file; None when it is missing or holds something else."""
    try:
        key = path.read_text(encoding="ascii").strip()
    except (FileNotFoundError, UnicodeDecodeError):
        return None
    return key if keys.prefix_of(key) else None


def write(path: Path, key: str) -> None:
    """Write a key file in one step, readable by its owner only."""
    draft = path.with_suffix(".new")
    draft.unlink(missing_ok=True)
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(key + "\n")
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)


def close(path: Path) -> None:
    """Take a file of ours away from all but its owner, if it is there and open to others."""
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        if mode & _OTHERS:
            path.chmod(mode & ~_OTHERS)
            LOG.warning("%s could be read by others (mode %04o); it is closed now", path, mode)
    except FileNotFoundError:
        return
    except OSError:  # Another's file, or a read-only mount
        LOG.error("%s can be read by others, and it is not ours to close", path)  # noqa: TRY400  # the sentence is enough


def check_given(config: Config) -> None:
    """Look at the secrets that were given to us.

    Raises:
        OpenSecretError: if one is missing, cannot be read by us, or can be read by others.
    """
    given = {
        "EDGE_TLS_KEY_FILE": config.tls_key_file,
        "CLOUD_JWS_KEY_FILE": config.cloud_jws_key_file,
        "CLOUD_KEY_FILE": config.cloud_key_file,
    }
    for variable, path in given.items():
        if path is not None:
            _check_private(variable, path)


def _check_private(variable: str, path: Path) -> None:
    try:
        found = path.stat()
    except OSError as error:
        raise OpenSecretError(f"{variable}: {path}: {error.strerror}") from None
    if not os.access(path, os.R_OK):
        raise OpenSecretError(f"{variable}: {path} cannot be read by us")
    of_root = found.st_uid == 0 and os.getuid() != 0
    if stat.S_IMODE(found.st_mode) & (_ROOTS_OTHERS if of_root else _OTHERS):
        mode = stat.S_IMODE(found.st_mode)
        raise OpenSecretError(
            f"{variable}: {path} can be read by others (mode {mode:04o}); "
            f"use `chmod 600` if nobody has read it, a new secret otherwise"
        )
