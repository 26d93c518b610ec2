"""Access keys: `fm_<prefix>_<secret>`; only a SHA-256 is stored in the database.

A secret is 32 random bytes, so a fast hash is enough: it cannot be guessed.
"""

import hashlib
import json
import re
import secrets
from enum import StrEnum
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, delete, func, insert, or_, select, update

from edge_server.store.rows.tables import access_key

_SHAPE: Final = re.compile(r"fm_([0-9a-f]{8})_([0-9a-f]{64})")


class Role(StrEnum):
    """Role of the owner of a key."""

    OPERATOR = "operator"
    BROKER = "broker"
    ADMIN = "admin"
    FARMER = "farmer"
    CLOUD = "cloud"


class Scope(StrEnum):
    """Restriction of a key; one without a scope has all rights of its role."""

    READ = "read"  # Requests that change nothing
    REPORT = "report"  # Reports of vehicles, and their registration
    METRICS = "metrics"  # Only the metrics


class StoredKey(NamedTuple):
    """What is stored of a key, without its secret."""

    prefix: str
    role: str
    sha256: bytes
    name: str = ""
    in_file: bool = False  # Is in STATE_DIR/keys/<role>.key
    scopes: frozenset[Scope] = frozenset()
    vehicle_ids: frozenset[int] | None = None  # None: every vehicle
    created_at: float = 0.0  # [s] since the epoch, as the two below
    expires_at: float | None = None
    revoked_at: float | None = None

    def is_valid(self, now: float) -> bool:
        """Whether it is neither revoked nor expired."""
        return self.revoked_at is None and (self.expires_at is None or now < self.expires_at)


def generate() -> str:
    """Make a new key."""
    return f"fm_{secrets.token_hex(4)}_{secrets.token_hex(32)}"


def prefix_of(key: str) -> str | None:
    """Return the part by which a key is found, None if the text is not a key of this server."""
    match = _SHAPE.fullmatch(key)
    return match.group(1) if match else None


def digest(secret: str) -> bytes:
    """Return the hash that is stored in place of a key, a session's secret or a link's token."""
    return hashlib.sha256(secret.encode()).digest()


def made_from(key: str, role: Role, name: str, now: float) -> StoredKey:
    """Return a key as it will be stored, without restrictions.

    Raises:
        ValueError: if the text is not a key.
    """
    prefix = prefix_of(key)
    if prefix is None:
        raise ValueError("not an access key")
    return StoredKey(prefix, role.value, digest(key), name, created_at=now)


_ACTIVE: Final = select(access_key).where(access_key.c.revoked_at.is_(None))
"""Made once: it is read every second."""


def active(connection: Connection) -> list[StoredKey]:
    """All keys that have not been revoked; some may have expired."""
    return [_key(row) for row in connection.execute(_ACTIVE)]


def everything(connection: Connection) -> list[StoredKey]:
    """All keys, oldest first, revoked ones too."""
    order = access_key.c.created_at, access_key.c.prefix
    return [_key(row) for row in connection.execute(select(access_key).order_by(*order))]


def find(connection: Connection, prefix: str) -> StoredKey | None:
    """Find a key by its prefix, revoked or not."""
    query = select(access_key).where(access_key.c.prefix == prefix)
    row = connection.execute(query).one_or_none()
    return _key(row) if row else None


def is_unlimited(key: StoredKey) -> bool:
    """Whether a key has all rights of its role and does not expire."""
    return not key.scopes and key.vehicle_ids is None and key.expires_at is None


def count_unlimited(connection: Connection, role: Role) -> int:
    """Count the keys of a role that have all its rights and do not expire."""
    return connection.execute(
        select(func.count())
        .select_from(access_key)
        .where(
            access_key.c.role == role.value,
            access_key.c.revoked_at.is_(None),
            access_key.c.expires_at.is_(None),
            access_key.c.scopes == "",
            access_key.c.vehicle_ids.is_(None),
        )
    ).scalar_one()


def add(connection: Connection, key: StoredKey) -> None:
    """Store a key; a known key stays as it is."""
    if find(connection, key.prefix) is not None:
        return
    vehicles = None if key.vehicle_ids is None else json.dumps(sorted(key.vehicle_ids))
    scopes = " ".join(sorted(key.scopes))
    row = {**key._asdict(), "scopes": scopes, "vehicle_ids": vehicles}
    connection.execute(insert(access_key), row)


def end(connection: Connection, prefix: str, at: float) -> None:
    """Let a key expire at a time in the future, unless it expires earlier."""
    connection.execute(
        update(access_key)
        .where(
            access_key.c.prefix == prefix,
            or_(access_key.c.expires_at.is_(None), access_key.c.expires_at > at),
        )
        .values(expires_at=at)
    )


def rename(connection: Connection, prefix: str, name: str) -> None:
    """Give a key another name."""
    connection.execute(update(access_key).where(access_key.c.prefix == prefix).values(name=name))


def revoke(connection: Connection, prefix: str, now: float) -> None:
    """Revoke a key."""
    connection.execute(
        update(access_key)
        .where(access_key.c.prefix == prefix, access_key.c.revoked_at.is_(None))
        .values(revoked_at=now)
    )


def delete_ended(connection: Connection, before: float) -> int:
    """Delete keys that were revoked or expired before a time.

    A key from a file stays: the file may still exist, and the key must not become valid again.
    """
    ended = (access_key.c.revoked_at < before) | (access_key.c.expires_at < before)
    return connection.execute(delete(access_key).where(ended, ~access_key.c.in_file)).rowcount


def _key(row: Any) -> StoredKey:
    return StoredKey(
        prefix=row.prefix,
        role=row.role,
        sha256=row.sha256,
        name=row.name,
        in_file=row.in_file,
        scopes=frozenset(Scope(word) for word in row.scopes.split()),
        vehicle_ids=None if row.vehicle_ids is None else frozenset(json.loads(row.vehicle_ids)),
        created_at=row.created_at,
        expires_at=row.expires_at,
        revoked_at=row.revoked_at,
    )
