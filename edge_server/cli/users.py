"""`python -m edge_server users ...`: accounts of people, at the machine's own command line."""

import argparse
import getpass
import sys
import time
from collections.abc import Callable
from typing import Final

from edge_server.config import Config
from edge_server.process.exit_codes import OK
from edge_server.services.administration import accounts
from edge_server.services.administration.accounts import AccountChange, AccountRequest
from edge_server.services.audit import shell_trail, use_trail
from edge_server.services.context import show_time
from edge_server.services.errors import ConflictError, NotFoundError
from edge_server.store.connection.database import Database

_MINUTE_S: Final = 60.0
Command = Callable[[Config, Database, argparse.Namespace], int]


def _list(_config: Config, database: Database, _options: argparse.Namespace) -> int:
    for person in accounts.everyone(database):
        seen = person.signed_in_at
        last = "never signed in" if seen is None else f"signed in at {show_time(seen)}"
        state = "disabled" if person.is_disabled else "active"
        print(f"{person.name:20}  {person.role:8}  {state:8}  {last}")
    return OK


def _create(_config: Config, database: Database, options: argparse.Namespace) -> int:
    password = None if options.without_password else _read_password()
    request = AccountRequest(name=options.name, role=options.role, password=password)
    accounts.create(database, request, time.time())
    return OK


def _password(_config: Config, database: Database, options: argparse.Namespace) -> int:
    accounts.change(database, options.name, AccountChange(password=_read_password()))
    return OK


def _disable(_config: Config, database: Database, options: argparse.Namespace) -> int:
    accounts.change(database, options.name, AccountChange(disabled=True))
    return OK


def _enable(_config: Config, database: Database, options: argparse.Namespace) -> int:
    accounts.change(database, options.name, AccountChange(disabled=False))
    return OK


def _delete(_config: Config, database: Database, options: argparse.Namespace) -> int:
    accounts.delete(database, options.name)
    return OK


def _link(config: Config, database: Database, options: argparse.Namespace) -> int:
    """Print the address that signs in once; create the account if a role is given.

    Raises:
        ConflictError: if there is an account with another role.
    """
    now = time.time()
    if options.role is not None:
        role = _role_of(database, options.name)
        if role is None:
            with use_trail(shell_trail("users.create", f"users/{options.name}", time.time)):
                accounts.create(database, AccountRequest(name=options.name, role=options.role), now)
        elif role != options.role:
            raise ConflictError(
                f"{options.name} has the role {role}: leave --role out, or change it in the console"
            )
    token = accounts.make_link(database, options.name, now, options.minutes * _MINUTE_S)
    scheme = "http" if config.tls_certificate_file is None else "https"
    host = "127.0.0.1" if config.host in {"0.0.0.0", "::"} else config.host  # noqa: S104  # compared
    print(f"{scheme}://{host}:{config.port}/console/#link={token}")
    return OK


def _role_of(database: Database, name: str) -> str | None:
    try:
        return accounts.find(database, name).role
    except NotFoundError:
        return None


def _read_password() -> str:
    """Ask at the terminal, or read a line of the standard input of a script."""
    if sys.stdin.isatty():
        return getpass.getpass("password: ")
    return sys.stdin.readline().rstrip("\n")


COMMANDS: Final[dict[str, Command]] = {
    "list": _list,
    "create": _create,
    "password": _password,
    "disable": _disable,
    "enable": _enable,
    "delete": _delete,
    "link": _link,
}
