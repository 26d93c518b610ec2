"""`python -m edge_server keys ...`, `users ...`, `audit ...`: commands that need no access key.

A key is named by its prefix, or by its name if one active key has it.
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

from afarcloud.faults import DocumentError
from edge_server.cli import users
from edge_server.config import Config
from edge_server.process import key_files, preparation
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.services import audit
from edge_server.services.administration import keys
from edge_server.services.administration.keys import KeyRequest
from edge_server.services.audit import shell_trail, use_trail
from edge_server.services.context import show_time
from edge_server.services.errors import NotFoundError, ServiceError
from edge_server.store.connection.database import Database
from edge_server.store.migrate import is_ready
from edge_server.store.rows.keys import Role, StoredKey

_HOUR_S: Final = 3600.0


def run(config: Config, options: argparse.Namespace) -> int:
    """Run the command that the options name; returns the exit code."""
    if not is_ready(config.database):
        preparation.prepare(config)
    with closing(preparation.open_database(config)) as database:
        try:
            if options.command == "users":
                subject = f"users/{getattr(options, 'name', '')}"
                with _audited(f"users.{options.access}", subject):
                    return users.COMMANDS[options.access](config, database, options)
            return _COMMANDS[options.access](config, database, options)
        except DocumentError as error:
            print(f"edge server: {error}", file=sys.stderr)
            return WRONG_SETUP
        except ValidationError as error:
            for fault in error.errors():
                place = ".".join(str(part) for part in fault["loc"])
                print(f"edge server: {place}: {fault['msg']}", file=sys.stderr)
            return WRONG_SETUP
        except ServiceError as error:
            print(f"edge server: {error}", file=sys.stderr)
            return FAILED
        except OSError as error:  # The key file cannot be written; its key is not created
            print(f"edge server: {error.filename}: {error.strerror}", file=sys.stderr)
            return FAILED


def _show_paths(config: Config, _database: Database, _options: argparse.Namespace) -> int:
    for role in Role:
        print(f"{role.value:10}{key_files.path_of(config.keys_dir, role)}")
    return OK


def _list(_config: Config, database: Database, _options: argparse.Namespace) -> int:
    now = time.time()
    for key in keys.everything(database):
        until = "" if key.expires_at is None else f"until {show_time(key.expires_at)}"
        vehicles = "" if key.vehicle_ids is None else f"vehicles {sorted(key.vehicle_ids)}"
        columns = [key.prefix, f"{key.role:8}", f"{keys.state_of(key, now):7}", f"{key.name:20}"]
        columns += [*sorted(key.scopes), vehicles, until]
        print("  ".join(column for column in columns if column).rstrip())
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
    with _audited("keys.create", f"keys/{request.name}"):
        _, secret = keys.create(database, request, now)
    print(secret)
    return OK


def _rotate(config: Config, database: Database, options: argparse.Namespace) -> int:
    now, overlap_s = time.time(), options.overlap_hours * _HOUR_S
    end = f"is valid until {show_time(now + overlap_s)}" if overlap_s else "is revoked"
    with _audited("keys.rotate", f"keys/{options.key}"):
        if options.key in list(Role):
            role = Role(options.key)
            path = key_files.rotate(database, config.keys_dir, role, now, overlap_s)
            print(f"new key in {path}; the old one {end}")
            return OK
        old = _named(database, options.key, now)
        if old.in_file:
            raise NotFoundError(f"{old.prefix} is in a key file: rotate {old.role}")
        _, secret = keys.replace(database, old.prefix, overlap_s, now)
    print(f"{old.prefix} {end}", file=sys.stderr)
    print(secret)
    return OK


def _revoke(_config: Config, database: Database, options: argparse.Namespace) -> int:
    now = time.time()
    with _audited("keys.revoke", f"keys/{options.key}"):
        key = _named(database, options.key, now)
        keys.revoke(database, key.prefix, now, last_admin_too=True)
    print(f"{key.prefix} ({key.name}, {key.role}) is revoked")
    return OK


def _export(_config: Config, database: Database, _options: argparse.Namespace) -> int:
    for row in audit.export(database):
        print(json.dumps(row, ensure_ascii=False))
    return OK


def _verify(_config: Config, database: Database, _options: argparse.Namespace) -> int:
    result = audit.verify(database)
    if result.fault is not None:
        print(f"edge server: the audit log is broken: {result.fault}", file=sys.stderr)
        return FAILED
    print(f"{result.rows} rows, intact")
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


@contextmanager
def _audited(action: str, subject: str) -> Iterator[None]:
    """Audit an action under the name of the shell's user."""
    with use_trail(shell_trail(action, subject, time.time)):
        yield


def _named(database: Database, name: str, now: float) -> StoredKey:
    """Find an active key by prefix or name; raises NotFoundError."""
    found = [key for key in keys.everything(database) if key.is_valid(now)]
    matching = [key for key in found if name in {key.prefix, key.name}]
    if not matching:
        raise NotFoundError(f"no active key {name}")
    if len(matching) > 1:
        prefixes = ", ".join(key.prefix for key in matching)
        raise NotFoundError(f"several keys are named {name}; use a prefix: {prefixes}")
    return matching[0]
