"""Access keys: `fm_<prefix>_<secret>`; only a SHA-256 is kept in the database.

A secret is 32 random bytes, so a fast hash is enough: there is nothing to guess.
"""

import hashlib
import re
import secrets
from enum import StrEnum
from typing import Final, NamedTuple

from sqlalchemy import Connection, insert, select, update
from sqlalchemy.dialects.sqlite import insert as upsert

from edge_server.store.tables import access_key

_SHAPE: Final = re.compile(r"fm_([0-9a-f]{8})_([0-9a-f]{64})")


class Role(StrEnum):
    """Who a key belongs to."""

    OPERATOR = "operator"
    BROKER = "broker"
    ADMIN = "admin"
    FARMER = "farmer"
    CLOUD = "cloud"


class StoredKey(NamedTuple):
    """What is known of a key without knowing it."""

    prefix: str
    role: str
    sha256: bytes


def generate() -> str:
    """Make a new key."""
    return f"fm_{secrets.token_hex(4)}_{secrets.token_hex(32)}"


def prefix_of(key: str) -> str | None:
    """Give the part by which a key is found, or None when it is not one of ours."""
    match = _SHAPE.fullmatch(key)
    return match.group(1) if match else None


def digest(key: str) -> bytes:
    """Give what is stored in place of the key."""
    return hashlib.sha256(key.encode()).digest()


def active(connection: Connection) -> list[StoredKey]:
    """All keys that open something."""
    rows = connection.execute(
        select(access_key.c.prefix, access_key.c.role, access_key.c.sha256).where(
            access_key.c.revoked_at.is_(None)
        )
    )
    return [StoredKey(*row) for row in rows]


def register(connection: Connection, role: str, key: str, now: float) -> None:
    """Let a key open what its role may; a known key stays as it is.

    Raises:
        ValueError: if the text is not a key.
    """
    prefix = prefix_of(key)
    if prefix is None:
        raise ValueError("not an access key")
    row = {"prefix": prefix, "role": role, "sha256": digest(key), "created_at": now}
    connection.execute(upsert(access_key).values(row).on_conflict_do_nothing())


def replace(connection: Connection, role: str, key: str, now: float) -> None:
    """Register a key and revoke the role's older ones."""
    connection.execute(
        update(access_key)
        .where(access_key.c.role == role, access_key.c.revoked_at.is_(None))
        .values(revoked_at=now)
    )
    connection.execute(
        insert(access_key).values(
            prefix=prefix_of(key), role=role, sha256=digest(key), created_at=now
        )
    )
