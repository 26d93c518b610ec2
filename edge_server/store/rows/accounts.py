"""Accounts of people, the sessions of their browsers, and links that sign in once.

A session is found like an access key, by a prefix, and only a SHA-256 of its secret is stored:
`fs_<prefix>_<secret>`.
"""

import re
import secrets
from typing import Any, Final, NamedTuple

from sqlalchemy import Connection, delete, func, insert, select, update

from edge_server.store.rows.keys import Role, StoredKey, digest
from edge_server.store.rows.tables import account, session, sign_in_link

_SESSION: Final = re.compile(r"fs_([0-9a-f]{8})_[0-9a-f]{64}")
NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


class Account(NamedTuple):
    """A person; `password` is its Argon2 hash, None if the person signs in by link only."""

    name: str
    role: str
    password: str | None
    created_at: float  # [s] since the epoch, as the next
    signed_in_at: float | None = None
    is_disabled: bool = False


class Session(NamedTuple):
    """A browser in which a person is signed in."""

    prefix: str
    sha256: bytes
    account: str
    created_at: float  # [s] since the epoch, as the next
    expires_at: float
    address: str  # From which the person signed in


def session_secret() -> str:
    """Make the secret of a new session."""
    return f"fs_{secrets.token_hex(4)}_{secrets.token_hex(32)}"


def link_token() -> str:
    """Make the token of a new link."""
    return secrets.token_urlsafe(32)


def prefix_of(secret: str) -> str | None:
    """Return the part by which a session is found, None if the text is no session's secret."""
    match = _SESSION.fullmatch(secret)
    return match.group(1) if match else None


# Accounts.


def find(connection: Connection, name: str) -> Account | None:
    """Find an account by its name; a text that cannot be a name is not looked up."""
    if NAME.fullmatch(name) is None:
        return None
    query = select(account).where(account.c.name == name)
    row = connection.execute(query).mappings().one_or_none()
    return Account(**row) if row else None


def everyone(connection: Connection) -> list[Account]:
    """All accounts, by name."""
    rows = connection.execute(select(account).order_by(account.c.name))
    return [Account(**row) for row in rows.mappings()]


def add(connection: Connection, person: Account) -> None:
    """Store a new account."""
    connection.execute(insert(account), person._asdict())


def change(connection: Connection, name: str, **values: Any) -> None:
    """Change columns of an account."""
    connection.execute(update(account).where(account.c.name == name).values(**values))


def remove(connection: Connection, name: str) -> None:
    """Delete an account with its sessions and links."""
    for table in (session, sign_in_link):
        connection.execute(delete(table).where(table.c.account == name))
    connection.execute(delete(account).where(account.c.name == name))


def count(connection: Connection) -> int:
    """Count the accounts."""
    return connection.execute(select(func.count()).select_from(account)).scalar_one()


# Sessions.


def add_session(connection: Connection, started: Session) -> None:
    """Store a new session."""
    connection.execute(insert(session), started._asdict())


def sessions(connection: Connection, now: float) -> list[Session]:
    """The sessions that have not expired, oldest first."""
    query = select(session).where(session.c.expires_at > now)
    rows = connection.execute(query.order_by(session.c.created_at, session.c.prefix))
    return [Session(**row) for row in rows.mappings()]


_SESSION_KEYS: Final = (
    select(session, account.c.role)
    .join_from(session, account, session.c.account == account.c.name)
    .where(~account.c.is_disabled)
)  # Made once: it is read every second


def session_keys(connection: Connection) -> list[StoredKey]:
    """Each session as the access key that it represents: the role and name of its account."""
    return [
        StoredKey(
            prefix=row.prefix,
            role=row.role,
            sha256=row.sha256,
            name=f"user/{row.account}",  # No access key has such a name
            created_at=row.created_at,
            expires_at=row.expires_at,
        )
        for row in connection.execute(_SESSION_KEYS)
    ]


def end_session(connection: Connection, prefix: str) -> bool:
    """End a session; false if there is none."""
    return connection.execute(delete(session).where(session.c.prefix == prefix)).rowcount > 0


def end_sessions(connection: Connection, name: str, keep: int = 0) -> None:
    """End the sessions of an account, except its newest `keep`."""
    query = select(session.c.prefix).where(session.c.account == name)
    newest = connection.execute(query.order_by(session.c.created_at.desc())).scalars().all()
    connection.execute(delete(session).where(session.c.prefix.in_(newest[keep:])))


# Links.


def add_link(connection: Connection, token: str, name: str, expires_at: float) -> None:
    """Store a link that signs in once."""
    row = {"sha256": digest(token), "account": name, "expires_at": expires_at}
    connection.execute(insert(sign_in_link), row)


def use_link(connection: Connection, token: str, now: float) -> str | None:
    """Use a link up; returns its account, None if it is unknown, used or expired."""
    mine = sign_in_link.c.sha256 == digest(token)
    row = connection.execute(select(sign_in_link).where(mine)).one_or_none()
    if row is None or connection.execute(delete(sign_in_link).where(mine)).rowcount == 0:
        return None  # Another request was faster
    return str(row.account) if now < row.expires_at else None


def remove_links(connection: Connection, name: str) -> None:
    """Remove the unused links of an account."""
    connection.execute(delete(sign_in_link).where(sign_in_link.c.account == name))


def delete_expired(connection: Connection, now: float) -> None:
    """Delete sessions and links that have expired."""
    for table in (session, sign_in_link):
        connection.execute(delete(table).where(table.c.expires_at <= now))


PEOPLE: Final = (Role.OPERATOR, Role.FARMER, Role.ADMIN)
"""Roles of accounts; the others are those of programs."""
