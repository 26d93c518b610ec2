"""Files with secrets: the first access key of each role, and configured files such as a TLS key.

`STATE_DIR/keys/<role>.key` is written once, with mode 0600. An operator may remove it; its key
stays valid, and `keys rotate` makes a new one and revokes the old one.

A file of this server that others can read gets mode 0600 again, with a warning. A configured file
that others can read is refused, because the server cannot know who has read it.

SecretFileError  a configured secret cannot be used, or others can read it
"""

import logging
import os
import stat
from pathlib import Path
from typing import Final

from sqlalchemy import Connection

from edge_server.config import Config
from edge_server.services import audit
from edge_server.services.administration import keys as service
from edge_server.services.errors import ConflictError
from edge_server.store.connection.database import Database
from edge_server.store.connection.locks import KEYS
from edge_server.store.files.backup import sync
from edge_server.store.rows import keys
from edge_server.store.rows.keys import Role

LOG = logging.getLogger(__name__)
_OTHERS: Final = 0o077
_ROOTS_OTHERS: Final = 0o037
"""A file of root may be readable by a group, as Debian's TLS keys are."""


class SecretFileError(Exception):
    """A configured secret cannot be used, or others can read it."""


def path_of(keys_dir: Path, role: Role) -> Path:
    """Path of a role's key file."""
    return keys_dir / f"{role.value}.key"


def ensure(database: Database, keys_dir: Path, now: float) -> None:
    """Create the missing keys, one per role; a new database adopts the keys in the files."""
    keys_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    with database.write(KEYS) as connection:
        have_key = {key.role for key in keys.active(connection) if key.in_file}
        for role in Role:
            path = path_of(keys_dir, role)
            restrict(path)
            key = read(path)
            if key is None and path.exists():
                LOG.error("%s holds no access key; remove it or rotate the key", path)
            elif key is not None:
                filed = _filed(key, role, now)
                keys.add(connection, filed)
                _name_others(_in_file(connection, role), filed.prefix, path)
            elif role.value not in have_key:
                key = keys.generate()
                keys.add(connection, _filed(key, role, now))
                write(path, key)


def _name_others(in_file: list[keys.StoredKey], prefix: str, path: Path) -> None:
    """Warn of keys that an interrupted rotation, a restored backup or a new file has left."""
    for one in in_file:
        if one.prefix != prefix and one.expires_at is None:
            LOG.warning(
                "besides the key in %s the key %s is valid; if nobody uses it: `keys revoke %s`",
                path,
                one.prefix,
                one.prefix,
            )


def rotate(
    database: Database, keys_dir: Path, role: Role, now: float, overlap_s: float = 0.0
) -> Path:
    """Make a new key for a role's file; the old one stays valid for `overlap_s` [s].

    Other keys of the role stay as they are. The new key is valid before it is in the file, and the
    old one until it no longer is: wherever this is interrupted, the key in the file is valid. What
    an interrupted rotation has left is ended by the next one. Returns the file.

    Raises:
        ConflictError: if another rotation of the role has come in between.
        OSError: if the file cannot be written.
    """
    path = path_of(keys_dir, role)
    keys_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    key = keys.generate()
    made = _filed(key, role, now)
    with database.write(KEYS) as connection:
        keys.add(connection, made)
        audit.about(f"keys/{made.prefix}")
        _write_draft(path, key)  # No key without a file that can be written
    with database.write(KEYS) as connection:
        if read(_draft_of(path)) != key:
            raise ConflictError(f"the key of {role.value} has been rotated by somebody else")
        replaced = [one for one in _in_file(connection, role) if one.prefix != made.prefix]
        for old in replaced:
            service.retire(connection, old, overlap_s, now)
            audit.about(f"keys/{old.prefix}")
        if not replaced:
            audit.changes_nothing()
        _put_in_place(path)
    return path


def _in_file(connection: Connection, role: Role) -> list[keys.StoredKey]:
    """Keys that are or were in the file of a role, and have not been revoked."""
    return [one for one in keys.active(connection) if one.in_file and one.role == role]


def _filed(key: str, role: Role, now: float) -> keys.StoredKey:
    return keys.made_from(key, role, role.value, now)._replace(in_file=True)


def read(path: Path) -> str | None:
    """Read a key file; None if it is missing or holds no key."""
    try:
        key = path.read_text(encoding="ascii").strip()
    except (FileNotFoundError, UnicodeDecodeError):
        return None
    return key if keys.prefix_of(key) else None


def write(path: Path, key: str) -> None:
    """Write a key file in one step, readable by its owner only."""
    _write_draft(path, key)
    _put_in_place(path)


def _draft_of(path: Path) -> Path:
    return path.with_suffix(".new")


def _write_draft(path: Path, key: str) -> None:
    draft = _draft_of(path)
    draft.unlink(missing_ok=True)
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(key + "\n")
        file.flush()
        os.fsync(file.fileno())


def _put_in_place(path: Path) -> None:
    _draft_of(path).replace(path)
    sync(path.parent)  # The old key may end next: a power failure must not bring its file back


def restrict(path: Path) -> None:
    """Make a file of this server readable by its owner only, if it exists."""
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        if mode & _OTHERS:
            path.chmod(mode & ~_OTHERS)
            LOG.warning(
                "%s could be read by others (mode %04o); its mode is restricted now", path, mode
            )
    except FileNotFoundError:
        return
    except OSError:  # Another's file, or a read-only mount
        LOG.error("%s can be read by others, and its mode cannot be changed", path)  # noqa: TRY400  # the sentence is enough


def check_given(config: Config) -> None:
    """Check the configured secrets.

    Raises:
        SecretFileError: if one is missing, unreadable, or readable by others.
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
        raise SecretFileError(f"{variable}: {path}: {error.strerror}") from None
    if not os.access(path, os.R_OK):
        raise SecretFileError(f"{variable}: {path} cannot be read by this process")
    of_root = found.st_uid == 0 and os.getuid() != 0
    if stat.S_IMODE(found.st_mode) & (_ROOTS_OTHERS if of_root else _OTHERS):
        mode = stat.S_IMODE(found.st_mode)
        raise SecretFileError(
            f"{variable}: {path} can be read by others (mode {mode:04o}); "
            f"use `chmod 600` if no one has read it, or a new secret"
        )
