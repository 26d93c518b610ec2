"""Key files `STATE_DIR/keys/<role>.key`: how the first keys get from us to those who use them.

A file is written once, with mode 0600. An operator may take it away; its key stays valid, and
`keys rotate` makes a new one and revokes the old.
"""

import logging
import os
from pathlib import Path

from edge_server.store import keys
from edge_server.store.database import Database
from edge_server.store.keys import Role

LOG = logging.getLogger(__name__)


def path_of(keys_dir: Path, role: Role) -> Path:
    """Where a role's key lies."""
    return keys_dir / f"{role.value}.key"


def ensure(database: Database, keys_dir: Path, now: float) -> None:
    """Make what is missing: a key per role, or in a new database the keys that lie there."""
    keys_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    with database.write() as connection:
        have_key = {key.role for key in keys.active(connection)}
        for role in Role:
            path = path_of(keys_dir, role)
            lying_there = read(path)
            if lying_there is not None:
                keys.register(connection, role.value, lying_there, now)
            elif path.exists():
                LOG.error("%s holds no access key; remove it or rotate the key", path)
            elif role.value not in have_key:
                key = keys.generate()
                keys.register(connection, role.value, key, now)
                write(path, key)


def rotate(database: Database, keys_dir: Path, role: Role, now: float) -> Path:
    """Make a new key for a role and revoke its older ones; returns the file."""
    path = path_of(keys_dir, role)
    keys_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    key = keys.generate()
    with database.write() as connection:
        keys.replace(connection, role.value, key, now)
        write(path, key)
    return path


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
