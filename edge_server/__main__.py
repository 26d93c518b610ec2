"""Command line: `python -m edge_server [serve|relay|migrate|backup|dead-letters|keys]`.

Without a word, server and relay together.
"""

import argparse
import logging
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from edge_server import logs
from edge_server.config import SETTINGS, Config, ConfigError, load
from edge_server.exit_codes import FAILED, OK, WRONG_SETUP
from edge_server.supervisor import PARENT_VARIABLE, Supervisor

LOG = logging.getLogger("edge_server")


def main(arguments: list[str]) -> int:
    """Run a command; returns the exit code."""
    options = _parser().parse_args(arguments)
    flags = {setting.name: getattr(options, setting.name) for setting in SETTINGS}
    try:
        config = load(flags, os.environ, options.config)
    except ConfigError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return WRONG_SETUP
    logs.configure(config.log_level, config.log_format)
    if options.command is None:
        return Supervisor(arguments).run()
    if parent := os.environ.get(PARENT_VARIABLE):
        from edge_server import children  # noqa: PLC0415  # only a part needs it

        children.die_with(int(parent))
    command: Callable[[Config, argparse.Namespace], int] = options.run
    return command(config, options)


def _serve(config: Config, _options: argparse.Namespace) -> int:
    from edge_server import server  # noqa: PLC0415  # each command loads what it needs

    try:
        server.serve(config)
    except server.PortTakenError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return WRONG_SETUP
    except server.UnpreparedError as error:
        return error.exit_code
    return OK


def _relay(config: Config, _options: argparse.Namespace) -> int:
    from edge_server import relay_process  # noqa: PLC0415  # as above
    from edge_server.outbox.relay import RelayError  # noqa: PLC0415  # as above

    try:
        relay_process.run(config)
    except relay_process.LockedError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return WRONG_SETUP
    except RelayError as error:
        LOG.error("the relay cannot go on: %s", error)  # noqa: TRY400  # the sentence is enough
        return FAILED
    return OK


def _migrate(config: Config, _options: argparse.Namespace) -> int:
    from edge_server import preparation  # noqa: PLC0415  # as above
    from edge_server.store.migrate import HEAD, StoreError  # noqa: PLC0415  # as above

    try:
        preparation.prepare(config)
    except StoreError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return FAILED
    print(f"{config.database_path} is at {HEAD}")
    return OK


def _back_up(config: Config, options: argparse.Namespace) -> int:
    from edge_server import backup  # noqa: PLC0415  # as above

    try:
        size = backup.back_up(config.database_path, options.target)
    except backup.BackupError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return FAILED
    print(f"{options.target}: {size} bytes")
    return OK


def _dead_letters(config: Config, options: argparse.Namespace) -> int:
    from edge_server import dead_letter_commands  # noqa: PLC0415  # as above
    from edge_server.services.errors import NotFoundError  # noqa: PLC0415  # as above

    code = OK
    try:
        for line in dead_letter_commands.run(config, options.action, options.id):
            if isinstance(line, NotFoundError):
                code = FAILED
            print(line, file=sys.stderr if isinstance(line, NotFoundError) else sys.stdout)
    except dead_letter_commands.NoDatabaseError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return WRONG_SETUP
    return code


def _show_paths(config: Config, _options: argparse.Namespace) -> int:
    from edge_server import key_files  # noqa: PLC0415  # as above
    from edge_server.store.keys import Role  # noqa: PLC0415  # as above

    for role in Role:
        print(f"{role.value:10}{key_files.path_of(config.keys_dir, role)}")
    return OK


def _rotate(config: Config, options: argparse.Namespace) -> int:
    from edge_server import key_files, preparation  # noqa: PLC0415  # as above
    from edge_server.store.keys import Role  # noqa: PLC0415  # as above
    from edge_server.store.migrate import is_ready  # noqa: PLC0415  # as above

    roles = [role.value for role in Role]
    if options.role not in roles:
        print(f"edge server: there is no role {options.role}: {', '.join(roles)}", file=sys.stderr)
        return WRONG_SETUP
    if not is_ready(config.database):
        preparation.prepare(config)
    database = preparation.open_database(config)
    path = key_files.rotate(database, config.keys_dir, Role(options.role), time.time())
    database.close()
    print(f"new key in {path}; the old one is revoked")
    return OK


_COMMANDS: Final = (
    ("serve", _serve, "serve the API"),
    ("relay", _relay, "send what is due to the cloud"),
    ("migrate", _migrate, "make or update the database, then end"),
)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="edge_server", description=__doc__)
    parser.add_argument("--config", type=Path, help="TOML file with a table [edge_server]")
    for setting in SETTINGS:
        flag = "--" + setting.name.replace("_", "-")
        parser.add_argument(flag, dest=setting.name, help=f"{setting.meaning} ({setting.variable})")
    commands = parser.add_subparsers(dest="command")
    for name, run, meaning in _COMMANDS:
        commands.add_parser(name, help=meaning).set_defaults(run=run)
    copy = commands.add_parser("backup", help="copy the database while it is in use")
    copy.add_argument("target", type=Path, help="the new file")
    copy.set_defaults(run=_back_up)
    letters = commands.add_parser("dead-letters", help="what the cloud has rejected")
    actions = letters.add_subparsers(dest="action", required=True)
    actions.add_parser("list", help="one line each").set_defaults(run=_dead_letters, id=[])
    for name, meaning in (("retry", "send once more"), ("discard", "give up for good")):
        action = actions.add_parser(name, help=meaning)
        action.add_argument("id", type=int, nargs="+")
        action.set_defaults(run=_dead_letters)
    keys = commands.add_parser("keys", help="access keys").add_subparsers(
        dest="keys_command", required=True
    )
    keys.add_parser("show-paths", help="where the keys lie").set_defaults(run=_show_paths)
    rotate = keys.add_parser("rotate", help="make a new key, revoke the old one")
    rotate.add_argument("role")
    rotate.set_defaults(run=_rotate)
    return parser


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main(sys.argv[1:]))
