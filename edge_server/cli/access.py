"""`python -m edge_server keys ...` and `audit ...`: access at the shell, which no key guards.

A key is named by its prefix, or by its name while one key of that name opens something.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from typing import Final

from pydantic import ValidationError

from edge_server.config import Config
from edge_server.process import preparation
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.security import key_files
from edge_server.services import audit, keys
from edge_server.services.audit import at_the_shell, on_trail
from edge_server.services.context import show_time
from edge_server.services.errors import NotFoundError, ServiceError
from edge_server.services.keys import KeyRequest
from edge_server.store.database import Database
from edge_server.store.keys import Role, StoredKey
from edge_server.store.migrate import is_ready

_HOUR_S: Final = 3600.0


def run(config: Config, options: argparse.Namespace) -> int:
    """Run the command that the options name; returns the exit code."""
    if not is_ready(config.database):
        preparation.prepare(config)
    command = _COMMANDS[options.access]
    with closing(preparation.open_database(config)) as database:
        try:
            return command(config, database, options)
        except ValidationError as error:
            for fault in error.errors():
                place = ".".join(str(part) for part in fault["loc"])
                _complain(f"edge server: {place}: {fault['msg']}")
            return WRONG_SETUP
        except ServiceError as error:
            _complain(f"edge server: {error}")
            return FAILED
        except OSError as error:  # A key file that cannot be written: its key is not made either
            _complain(f"edge server: {error.filename}: {error.strerror}")
            return FAILED


def _show_paths(config: Config, _database: Database, _options: argparse.Namespace) -> int:
    for role in Role:
        _say(f"{role.value:10}{key_files.path_of(config.keys_dir, role)}")
    return OK


def _list(_config: Config, database: Database, _options: argparse.Namespace) -> int:
    now = time.time()
    for key in keys.everything(database):
        until = "" if key.expires_at is None else f"until {show_time(key.expires_at)}"
        vehicles = "" if key.vehicle_ids is None else f"vehicles {sorted(key.vehicle_ids)}"
        words = [key.prefix, f"{key.role:8}", f"{keys.state_of(key, now):7}", f"{key.name:20}"]
        words += [*sorted(key.scopes), vehicles, until]
        _say("  ".join(word for word in words if word).rstrip())
    return OK


def _create(_config: Config, database: Database, options: argparse.Namespace) -> int:
    now = time.time()
    expires_at = None
    if options.hours is not None:
        expires_at = datetime.fromtimestamp(now + options.hours * _HOUR_S, UTC)
    request = KeyRequest(
        name=options.name,
        role=options.role,
        scopes=tuple(options.scope),
        vehicle_ids=tuple(options.vehicle) or None,
        expires_at=expires_at,
    )
    with _told("keys.create", f"keys/{request.name}"):
        _, secret = keys.create(database, request, now)
    _say(secret)
    return OK


def _rotate(config: Config, database: Database, options: argparse.Namespace) -> int:
    now, overlap_s = time.time(), options.overlap_hours * _HOUR_S
    end = f"opens until {show_time(now + overlap_s)}" if overlap_s else "is revoked"
    with _told("keys.rotate", f"keys/{options.key}"):
        if options.key in list(Role):
            role = Role(options.key)
            path = key_files.rotate(database, config.keys_dir, role, now, overlap_s)
            _say(f"new key in {path}; the old one {end}")
            return OK
        old = _named(database, options.key, now)
        if old.in_file:
            raise NotFoundError(f"{old.prefix} lies in a file: rotate {old.role}")
        _, secret = keys.replace(database, old.prefix, overlap_s, now)
    _complain(f"{old.prefix} {end}")
    _say(secret)
    return OK


def _revoke(_config: Config, database: Database, options: argparse.Namespace) -> int:
    now = time.time()
    with _told("keys.revoke", f"keys/{options.key}"):
        key = _named(database, options.key, now)
        keys.revoke(database, key.prefix, now, last_admin_too=True)
    _say(f"{key.prefix} ({key.name}, {key.role}) opens nothing any more")
    return OK


def _export(_config: Config, database: Database, _options: argparse.Namespace) -> int:
    for row in audit.exported(database):
        _say(json.dumps(row, ensure_ascii=False))
    return OK


def _verify(_config: Config, database: Database, _options: argparse.Namespace) -> int:
    verdict = audit.verify(database)
    if verdict.fault is not None:
        _complain(f"edge server: the audit log is broken: {verdict.fault}")
        return FAILED
    _say(f"{verdict.rows} rows, whole")
    return OK


_COMMANDS: Final[dict[str, Callable[[Config, Database, argparse.Namespace], int]]] = {
    "show-paths": _show_paths,
    "list": _list,
    "create": _create,
    "rotate": _rotate,
    "revoke": _revoke,
    "export": _export,
    "verify": _verify,
}


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


def _complain(line: str) -> None:
    sys.stderr.write(line + "\n")


@contextmanager
def _told(action: str, subject: str) -> Iterator[None]:
    """Do something that the audit log is told of, under the name of the shell's user."""
    with on_trail(at_the_shell(action, subject, time.time)):
        yield


def _named(database: Database, name: str, now: float) -> StoredKey:
    """Find the key that is meant; raises NotFoundError."""
    found = [key for key in keys.everything(database) if key.opens(now)]
    meant = [key for key in found if name in {key.prefix, key.name}]
    if not meant:
        raise NotFoundError(f"no key {name} opens anything")
    if len(meant) > 1:
        prefixes = ", ".join(key.prefix for key in meant)
        raise NotFoundError(f"several keys are called {name}, say which: {prefixes}")
    return meant[0]
