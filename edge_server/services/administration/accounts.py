"""Accounts of people and their sessions: made, changed, ended; one transaction each.

A person signs in with name and password, or by a link that an admin or the shell has made. The
session takes the account's present role at every request, so a change of role, a new password and
disabling take effect at once.
"""

from typing import Annotated, Any, Final

from pydantic import Field, model_validator

from afarcloud.faults import Fault, InvalidError
from afarcloud.numbers import Model
from edge_server.services import audit
from edge_server.services.administration import passwords
from edge_server.services.administration.keys import Name
from edge_server.services.context import show_time
from edge_server.services.errors import ConflictError, NotFoundError
from edge_server.store.connection.database import Database
from edge_server.store.connection.locks import KEYS
from edge_server.store.rows import accounts, keys
from edge_server.store.rows.accounts import Account, Session
from edge_server.store.rows.keys import Role

MOST_ACCOUNTS: Final = 200
MOST_SESSIONS: Final = 20
"""Of one account; the oldest ends when another begins."""
LINK_VALID_S: Final = 600.0
Password = Annotated[str, Field(min_length=10, max_length=200)]


class AccountRequest(Model):
    """Request for an account; one without a password signs in by link only."""

    name: Name
    role: Role
    password: Password | None = None


class AccountChange(Model):
    """Change of an account: only the members that are given."""

    role: Role | None = None
    password: Password | None = None
    disabled: bool | None = None


class SignIn(Model):
    """Name and password, or the token of a link."""

    name: Name | None = None
    password: str | None = Field(default=None, min_length=1, max_length=200)
    link: str | None = Field(default=None, min_length=1, max_length=100)

    @model_validator(mode="after")
    def _is_one_of_both(self) -> "SignIn":
        named = self.name is not None and self.password is not None
        if named == (self.link is not None) or (self.name is None) != (self.password is None):
            raise ValueError("must have `name` and `password`, or `link`")
        return self


# Accounts.


def create(database: Database, request: AccountRequest, now: float) -> Account:
    """Make an account.

    Raises:
        InvalidError: if the role is that of a program.
        ConflictError: if there are too many, or one of this name.
    """
    _check_role(request.role)
    password = None if request.password is None else passwords.hashed(request.password)
    made = Account(request.name, request.role.value, password, now)
    with database.write(KEYS) as connection:
        if accounts.find(connection, made.name) is not None:
            taken = (Fault("name", "is the name of an account"),)
            raise ConflictError(f"there is an account {made.name} already", taken)
        if accounts.count(connection) >= MOST_ACCOUNTS:
            raise ConflictError(
                f"there are {MOST_ACCOUNTS} accounts, the maximum; delete one first"
            )
        accounts.add(connection, made)
        audit.about(f"users/{made.name}")
    return made


def change(database: Database, name: str, request: AccountChange) -> Account:
    """Change an account; a new password and disabling end its sessions.

    Raises:
        InvalidError: if the role is that of a program.
        NotFoundError: if there is no such account.
    """
    values: dict[str, Any] = {}
    if request.role is not None:
        _check_role(request.role)
        values["role"] = request.role.value
    if request.password is not None:
        values["password"] = passwords.hashed(request.password)
    if request.disabled is not None:
        values["is_disabled"] = request.disabled
    with database.write(KEYS) as connection:
        before = _find(accounts.find(connection, name), name)
        if values:
            accounts.change(connection, name, **values)
        if request.password is not None or request.disabled:
            accounts.end_sessions(connection, name)
            accounts.remove_links(connection, name)
    return before._replace(**values)


def delete(database: Database, name: str) -> None:
    """Delete an account with its sessions.

    Raises:
        NotFoundError: if there is no such account.
    """
    with database.write(KEYS) as connection:
        _find(accounts.find(connection, name), name)
        accounts.remove(connection, name)


def everyone(database: Database) -> list[Account]:
    """All accounts, by name."""
    with database.read() as connection:
        return accounts.everyone(connection)


def find(database: Database, name: str) -> Account:
    """Return one account; raises NotFoundError."""
    with database.read() as connection:
        return _find(accounts.find(connection, name), name)


def make_link(database: Database, name: str, now: float, valid_s: float = LINK_VALID_S) -> str:
    """Make a link that signs a person in once; returns its token, which is not stored.

    Raises:
        NotFoundError: if there is no such account, or it is disabled.
    """
    token = accounts.link_token()
    with database.write(KEYS) as connection:
        person = _find(accounts.find(connection, name), name)
        if person.is_disabled:
            raise NotFoundError(f"the account {name} is disabled")
        accounts.add_link(connection, token, name, now + valid_s)
        audit.about(f"users/{name}")
    return token


# Sessions.


def sign_in(
    database: Database, request: SignIn, now: float, valid_s: float, address: str
) -> tuple[Account, Session, str] | None:
    """Begin a session; returns it with its secret, None if the person is not admitted.

    Raises:
        TooMuchError: if too many passwords are compared at the moment.
    """
    name = request.name
    if name is not None:
        with database.read() as connection:
            person = accounts.find(connection, name)
        expected = None if person is None else person.password
        if not passwords.is_right(request.password or "", expected):
            return None
    secret = accounts.session_secret()
    prefix = accounts.prefix_of(secret) or ""
    with database.write(KEYS) as connection:
        if name is None:
            name = accounts.use_link(connection, request.link or "", now)
        person = None if name is None else accounts.find(connection, name)
        # It may have been changed while the old one was compared
        has_old_password = request.name is not None and person and person.password != expected
        if name is None or person is None or person.is_disabled or has_old_password:
            audit.changes_nothing()  # The refusal is recorded in its place
            return None
        started = Session(prefix, keys.digest(secret), name, now, now + valid_s, address[:64])
        accounts.end_sessions(connection, name, keep=MOST_SESSIONS - 1)
        accounts.add_session(connection, started)
        accounts.change(connection, name, signed_in_at=now)
        audit.about(f"users/{name}")
    return person, started, secret


def end_session(database: Database, prefix: str) -> None:
    """End a session; raises NotFoundError."""
    with database.write(KEYS) as connection:
        if not accounts.end_session(connection, prefix):
            raise NotFoundError(f"there is no session {prefix}")


def sessions(database: Database, now: float) -> list[Session]:
    """The sessions that have not expired, oldest first."""
    with database.read() as connection:
        return accounts.sessions(connection, now)


# As the API shows them.


def show(person: Account) -> dict[str, Any]:
    """Return an account as the API shows it, without its password."""
    return {
        "name": person.name,
        "role": person.role,
        "has_password": person.password is not None,
        "disabled": person.is_disabled,
        "created_at": show_time(person.created_at),
        "last_sign_in_at": None if person.signed_in_at is None else show_time(person.signed_in_at),
    }


def show_session(session: Session) -> dict[str, Any]:
    """Return a session as the API shows it, without its secret."""
    return {
        "id": session.prefix,
        "name": session.account,
        "address": session.address,
        "created_at": show_time(session.created_at),
        "expires_at": show_time(session.expires_at),
    }


def _check_role(role: Role) -> None:
    if role not in accounts.PEOPLE:
        allowed = ", ".join(accounts.PEOPLE)
        raise InvalidError((Fault("role", f"must be one of {allowed}: a program has a key"),))


def _find(person: Account | None, name: str) -> Account:
    if person is None:
        raise NotFoundError(f"there is no account {name}")
    return person
