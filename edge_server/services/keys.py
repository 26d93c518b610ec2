"""Access keys: made, listed, replaced, revoked; one transaction each. The secret is told once."""

from typing import Annotated, Any, Final

from pydantic import Field
from sqlalchemy import Connection

from afarcloud.faults import Fault, InvalidError
from afarcloud.model import Model
from afarcloud.numbers import Time, VehicleId
from edge_server.services import audit
from edge_server.services.context import show_time
from edge_server.services.errors import ConflictError, NotFoundError
from edge_server.store import keys
from edge_server.store.database import Database
from edge_server.store.keys import Role, Scope, StoredKey
from edge_server.store.locks import KEYS

MOST_KEYS: Final = 1000
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]


class KeyRequest(Model):
    """A key that is wanted; what is not said narrows nothing."""

    name: Name
    role: Role
    scopes: tuple[Scope, ...] = Field(default=(), max_length=len(Scope))
    vehicle_ids: tuple[VehicleId, ...] | None = Field(default=None, min_length=1, max_length=250)
    expires_at: Time | None = None


def create(database: Database, request: KeyRequest, now: float) -> tuple[StoredKey, str]:
    """Make a key; returns what is kept of it, and the key itself, which nobody can tell again.

    Raises:
        InvalidError: if it would have expired before it is made.
        ConflictError: if there are too many, or one of this name is in use.
    """
    expires_at = request.expires_at.timestamp() if request.expires_at else None
    if expires_at is not None and expires_at <= now:
        raise InvalidError((Fault("expires_at", "must lie ahead"),))
    secret = keys.generate()
    key = keys.made_from(secret, request.role, request.name, now)._replace(
        scopes=frozenset(request.scopes),
        vehicle_ids=None if request.vehicle_ids is None else frozenset(request.vehicle_ids),
        expires_at=expires_at,
    )
    with database.write(KEYS) as connection:
        _check_name(connection, key, now)
        keys.add(connection, key)
        audit.about(f"keys/{key.prefix}")
    return key, secret


def replace(database: Database, prefix: str, overlap_s: float, now: float) -> tuple[StoredKey, str]:
    """Make a key that opens the same; the old one opens for `overlap_s` [s] more.

    Raises:
        NotFoundError: if no key of this prefix opens anything.
    """
    secret = keys.generate()
    with database.write(KEYS) as connection:
        old = _active(connection, prefix, now)
        made = keys.made_from(secret, Role(old.role), old.name, now)
        new = old._replace(prefix=made.prefix, sha256=made.sha256, created_at=now)
        keys.add(connection, new)
        retire(connection, old, overlap_s, now)
        audit.about(f"keys/{old.prefix}")
        audit.about(f"keys/{new.prefix}")
    return new, secret


def retire(connection: Connection, key: StoredKey, overlap_s: float, now: float) -> None:
    """Let a key open nothing any more, now or after an overlap [s]."""
    if overlap_s > 0:
        keys.end(connection, key.prefix, now + overlap_s)
    else:
        keys.revoke(connection, key.prefix, now)


def revoke(database: Database, prefix: str, now: float, *, last_admin_too: bool = False) -> None:
    """Let a key open nothing any more.

    Raises:
        NotFoundError: if no key of this prefix opens anything.
        ConflictError: if nobody could administer after that.
    """
    with database.write(KEYS) as connection:
        key = _active(connection, prefix, now)
        keys.revoke(connection, prefix, now)
        if key.role != Role.ADMIN or last_admin_too or not keys.is_unlimited(key):
            return
        if keys.count_unlimited(connection, Role.ADMIN) == 0:
            raise ConflictError(
                "this is the last key of an admin that does not expire; revoke it at the shell"
            )


def everything(database: Database) -> list[StoredKey]:
    """All keys, oldest first, revoked ones too."""
    with database.read() as connection:
        return keys.everything(connection)


def find(database: Database, prefix: str) -> StoredKey:
    """Give one key; raises NotFoundError."""
    with database.read() as connection:
        return _find(connection, prefix)


def state_of(key: StoredKey, now: float) -> str:
    """Say in a word whether a key opens anything."""
    if key.revoked_at is not None:
        return "revoked"
    return "active" if key.opens(now) else "expired"


def show(key: StoredKey, now: float) -> dict[str, Any]:
    """Give a key as the API shows it, without its secret."""
    return {
        "prefix": key.prefix,
        "name": key.name,
        "role": key.role,
        "scopes": sorted(key.scopes),
        "vehicle_ids": None if key.vehicle_ids is None else sorted(key.vehicle_ids),
        "state": state_of(key, now),
        "created_at": show_time(key.created_at),
        "expires_at": None if key.expires_at is None else show_time(key.expires_at),
        "revoked_at": None if key.revoked_at is None else show_time(key.revoked_at),
    }


def _check_name(connection: Connection, key: StoredKey, now: float) -> None:
    in_use = [other for other in keys.active(connection) if other.opens(now)]
    if any(other.name == key.name for other in in_use):
        taken = (Fault("name", "is the name of a key that is in use"),)
        raise ConflictError(f"there is a key {key.name} already", taken)
    if len(in_use) >= MOST_KEYS:
        raise ConflictError(f"{MOST_KEYS} keys are in use, no more fit")


def _find(connection: Connection, prefix: str) -> StoredKey:
    key = keys.find(connection, prefix)
    if key is None:
        raise NotFoundError(f"there is no key {prefix}")
    return key


def _active(connection: Connection, prefix: str, now: float) -> StoredKey:
    key = _find(connection, prefix)
    if not key.opens(now):
        raise NotFoundError(f"the key {prefix} opens nothing any more")
    return key
