"""Access keys: made, listed, replaced, revoked; one transaction each. A secret is shown once."""

from typing import Annotated, Any, Final

from pydantic import Field
from sqlalchemy import Connection

from afarcloud.faults import Fault, InvalidError
from afarcloud.numbers import Model, Time, VehicleId
from edge_server.services import audit
from edge_server.services.context import show_time
from edge_server.services.errors import ConflictError, NotFoundError
from edge_server.store.connection.database import Database
from edge_server.store.connection.locks import KEYS
from edge_server.store.rows import keys
from edge_server.store.rows.keys import Role, Scope, StoredKey

MOST_KEYS: Final = 1000
MOST_NAME: Final = 64
"""Length of a name."""
Name = Annotated[str, Field(pattern=rf"^[A-Za-z0-9][A-Za-z0-9._-]{{0,{MOST_NAME - 1}}}$")]


class KeyRequest(Model):
    """Request for a key; fields that are not given restrict nothing."""

    name: Name
    role: Role
    scopes: tuple[Scope, ...] = Field(default=(), max_length=len(Scope))
    vehicle_ids: tuple[VehicleId, ...] | None = Field(default=None, min_length=1, max_length=250)
    expires_at: Time | None = None


def create(database: Database, request: KeyRequest, now: float) -> tuple[StoredKey, str]:
    """Make a key; returns what is stored of it, and the key itself, which is not stored.

    Raises:
        InvalidError: if `expires_at` is in the past.
        ConflictError: if there are too many, or a key of this name is in use.
    """
    expires_at = request.expires_at.timestamp() if request.expires_at else None
    if expires_at is not None and expires_at <= now:
        raise InvalidError((Fault("expires_at", "must be in the future"),))
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
    """Make a key with the same rights; the old one stays valid for `overlap_s` [s].

    Raises:
        NotFoundError: if no key of this prefix is valid.
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
    """End a key that a new one replaces, now or after an overlap [s]; its name goes to that one."""
    suffix = f".replaced-{key.prefix}"
    if not key.name.endswith(suffix):  # A key in its overlap has given its name away already
        keys.rename(connection, key.prefix, key.name[: MOST_NAME - len(suffix)] + suffix)
    if overlap_s > 0:
        keys.end(connection, key.prefix, now + overlap_s)
    else:
        keys.revoke(connection, key.prefix, now)


def revoke(database: Database, prefix: str, now: float, *, last_admin_too: bool = False) -> None:
    """Revoke a key.

    Raises:
        NotFoundError: if no key of this prefix is valid.
        ConflictError: if it is the last key of an admin that does not expire.
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
    """Return one key; raises NotFoundError."""
    with database.read() as connection:
        return _find(connection, prefix)


def state_of(key: StoredKey, now: float) -> str:
    """Return whether a key is active, revoked or expired."""
    if key.revoked_at is not None:
        return "revoked"
    return "active" if key.is_valid(now) else "expired"


def show(key: StoredKey, now: float) -> dict[str, Any]:
    """Return a key as the API shows it, without its secret."""
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
    in_use = [other for other in keys.active(connection) if other.is_valid(now)]
    if any(other.name == key.name for other in in_use):
        taken = (Fault("name", "is the name of a key that is in use"),)
        raise ConflictError(f"there is a key {key.name} already", taken)
    if len(in_use) >= MOST_KEYS:
        raise ConflictError(f"{MOST_KEYS} keys are in use, the maximum; revoke one first")


def _find(connection: Connection, prefix: str) -> StoredKey:
    key = keys.find(connection, prefix)
    if key is None:
        raise NotFoundError(f"there is no key {prefix}")
    return key


def _active(connection: Connection, prefix: str, now: float) -> StoredKey:
    key = _find(connection, prefix)
    if not key.is_valid(now):
        raise NotFoundError(f"the key {prefix} is expired or revoked")
    return key
