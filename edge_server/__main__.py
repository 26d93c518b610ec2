"""Command line: `python -m edge_server [COMMAND]`; without a command: server and relay."""

import os
import signal

if __name__ == "__main__":  # A signal while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))

import argparse
import logging
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from edge_server import logs
from edge_server.config import SETTINGS, Config, ConfigError, load
from edge_server.process.exit_codes import FAILED, INTERRUPTED, OK, WRONG_SETUP
from farm_flight_bridge import VERSION, program_name

LOG = logging.getLogger("edge_server")


def main(arguments: list[str] | None = None) -> int:
    """Run a command, by default that of the command line; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(arguments)
    flags = {setting.name: getattr(options, setting.name) for setting in SETTINGS}
    try:
        config = load(flags, os.environ, options.config)
    except ConfigError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return WRONG_SETUP
    logs.configure(config.log_level, config.log_format)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # Ignored, as may be inherited, it hides ends
    command: Callable[[Config, argparse.Namespace], int]
    command = _supervise if options.command is None else options.run
    if command in _PROCESSES:
        signal.signal(signal.SIGTERM, _end_well)  # Each handles it later by itself
        return command(config, options)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # A command cleans up behind itself
    try:
        return command(config, options)
    except KeyboardInterrupt:
        return INTERRUPTED


def _end_well(*_: object) -> None:
    """End a program that is stopped before it has begun; PID 1 gets only signals it handles."""
    os._exit(OK)


def _supervise(config: Config, options: argparse.Namespace) -> int:
    """Run server and relay as child processes."""
    from edge_server.process import supervisor  # noqa: PLC0415  # each command loads its modules

    kinds = (
        supervisor.Kind("serve", partial(_serve, config, options), is_vital=True),
        supervisor.Kind("relay", partial(_relay, config, options), is_vital=False),
    )
    supervised = supervisor.Supervisor(kinds, config)
    supervisor.load_shared_modules(config)
    return supervised.run()


def _serve(config: Config, _options: argparse.Namespace) -> int:
    from edge_server.process import server  # noqa: PLC0415  # as above

    try:
        server.serve(config)
    except (server.FewDescriptorsError, server.PortTakenError, server.TlsSetupError) as error:
        print(f"edge server: {error}", file=sys.stderr)
        return WRONG_SETUP
    except server.UnpreparedError as error:
        return error.exit_code
    return OK


def _relay(config: Config, _options: argparse.Namespace) -> int:
    from edge_server.outbox.relay import RelayError  # noqa: PLC0415  # as above
    from edge_server.process import relay  # noqa: PLC0415  # as above

    try:
        relay.run(config)
    except (ConfigError, relay.LockedError) as error:
        print(f"edge server: {error}", file=sys.stderr)
        return WRONG_SETUP
    except RelayError as error:
        LOG.error("the relay cannot continue: %s", error)  # noqa: TRY400  # the sentence is enough
        return FAILED
    return OK


def _migrate(config: Config, _options: argparse.Namespace) -> int:
    from edge_server.process import preparation  # noqa: PLC0415  # as above
    from edge_server.process.key_files import SecretFileError  # noqa: PLC0415  # as above
    from edge_server.store.migrate import HEAD, StoreError  # noqa: PLC0415  # as above

    try:
        preparation.prepare(config)
    except (ConfigError, SecretFileError, StoreError) as error:
        print(f"edge server: {error}", file=sys.stderr)
        return FAILED
    print(f"{config.database_name} is at {HEAD}")
    return OK


def _back_up(config: Config, options: argparse.Namespace) -> int:
    from edge_server.cli import backup  # noqa: PLC0415  # as above

    return backup.run(config, options.target, options.keep)


def _restore(config: Config, options: argparse.Namespace) -> int:
    from edge_server.cli import backup  # noqa: PLC0415  # as above

    return backup.run_restore(config, options.source)


def _dead_letters(config: Config, options: argparse.Namespace) -> int:
    from edge_server.cli import dead_letters  # noqa: PLC0415  # as above
    from edge_server.services.errors import ServiceError  # noqa: PLC0415  # as above

    code = OK
    try:
        for line in dead_letters.run(config, options.action, options.id, options.file):
            if isinstance(line, ServiceError):
                code = FAILED
            print(line, file=sys.stderr if isinstance(line, ServiceError) else sys.stdout)
    except dead_letters.UnreadableError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return FAILED
    except dead_letters.NoDatabaseError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return WRONG_SETUP
    return code


def _access(config: Config, options: argparse.Namespace) -> int:
    from edge_server.cli import access  # noqa: PLC0415  # as above
    from edge_server.store.migrate import StoreError  # noqa: PLC0415  # as above

    try:
        return access.run(config, options)
    except StoreError as error:
        print(f"edge server: {error}", file=sys.stderr)
        return FAILED


_PROCESSES: Final = (_supervise, _serve, _relay)
"""Commands that handle signals themselves."""
_COMMANDS: Final = (
    ("serve", _serve, "serve the API"),
    ("relay", _relay, "send records to the cloud"),
    ("migrate", _migrate, "create or migrate the database, then exit"),
)


_YEAR_H: Final = 8784
"""Longest validity that a command gives a key with an end: a leap year."""
_WEEK_MIN: Final = 10_080
"""Longest validity of a link that signs a person in."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program_name("edge_server"),
        description="The farm's edge server; without a command it serves and sends to the cloud.",
        epilog="Exit status: 0 done, or ended by a signal; 1 failed; 2 a wrong setting, a port or "
        "database that cannot be used; 130 a command that Ctrl-C has ended.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {VERSION}")
    parser.add_argument("--config", type=Path, help="TOML file with a table [edge_server]")
    for setting in SETTINGS:
        flag = "--" + setting.name.replace("_", "-")
        parser.add_argument(flag, dest=setting.name, help=f"{setting.meaning} ({setting.variable})")
    commands = parser.add_subparsers(dest="command")
    for name, run, meaning in _COMMANDS:
        commands.add_parser(name, help=meaning).set_defaults(run=run)
    copy = commands.add_parser("backup", help="back up the database while it is in use")
    copy.add_argument(
        "target", type=_target, help="the new file, or a folder for a file named by time"
    )
    copy.add_argument(
        "--keep", type=_count, metavar="NUMBER", help="in a folder: delete all but the newest"
    )
    copy.set_defaults(run=_back_up)
    restored = commands.add_parser("restore", help="put a backup in the place of the database")
    restored.add_argument("source", type=Path, help="the backup; server and relay must be stopped")
    restored.set_defaults(run=_restore)
    letters = commands.add_parser("dead-letters", help="reports that the cloud has rejected")
    actions = letters.add_subparsers(dest="action", required=True)
    for name, meaning in (
        ("list", "list them, one line each"),
        ("export", "export them as NDJSON"),
        ("retry-all", "retry all of them"),
    ):
        actions.add_parser(name, help=meaning).set_defaults(run=_dead_letters, id=[], file=None)
    edit = actions.add_parser("edit", help="correct one and retry it")
    edit.add_argument("id", type=int, nargs=1, help="of the dead letter, as listed")
    edit.add_argument("file", type=Path, help="JSON file with the corrected report")
    edit.set_defaults(run=_dead_letters)
    for name, meaning in (("retry", "retry them"), ("discard", "discard them")):
        action = actions.add_parser(name, help=meaning)
        action.add_argument("id", type=int, nargs="+", help="of the dead letters, as listed")
        action.set_defaults(run=_dead_letters, file=None)
    _add_access(commands)
    return parser


def _target(text: str) -> Path:
    """Read the target of a backup; one that is written as a folder has to be one."""
    path = Path(text)
    if text.endswith("/") and not path.is_dir():
        raise argparse.ArgumentTypeError(f"there is no folder {text}")
    return path


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return int(text)


def _number(text: str, high: float, *, above_0: bool = True) -> float:
    """Read a finite number from 0, or above it, to `high`."""
    number = float(text)
    if not 0.0 <= number <= high or (above_0 and number == 0.0):
        low = "above 0, at most" if above_0 else "0 to"
        raise argparse.ArgumentTypeError(f"must be {low} {high}, not {text}")
    return number


def _hours_above_0(text: str) -> float:
    return _number(text, _YEAR_H)


def _hours(text: str) -> float:
    return _number(text, _YEAR_H, above_0=False)


def _minutes(text: str) -> float:
    return _number(text, _WEEK_MIN)


def _add_access(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    keys = commands.add_parser("keys", help="access keys").add_subparsers(
        dest="access", required=True
    )
    keys.add_parser("show-paths", help="paths of the key files")
    keys.add_parser("list", help="all keys, without their secrets")
    create = keys.add_parser("create", help="create a key; its secret is shown once")
    create.add_argument("role", help="operator, farmer, broker, cloud or admin")
    create.add_argument("name", help="how it is called in lists and in the audit log")
    create.add_argument("--scope", action="append", default=[], help="read, report or metrics")
    create.add_argument(
        "--vehicle", type=int, action="append", default=[], help="vehicle_id it is restricted to"
    )
    create.add_argument("--hours", type=_hours_above_0, help=f"hours it is valid (to {_YEAR_H})")
    rotate = keys.add_parser("rotate", help="replace a key by a new one")
    rotate.add_argument("key", help="a role (its key file), or a key's name or prefix")
    rotate.add_argument(
        "--overlap-hours",
        type=_hours,
        default=0.0,
        help=f"hours the old one stays valid (0 to {_YEAR_H})",
    )
    revoke = keys.add_parser("revoke", help="revoke a key")
    revoke.add_argument("key", help="its name or prefix")
    log = commands.add_parser("audit", help="audit log").add_subparsers(
        dest="access", required=True
    )
    log.add_parser("export", help="export the log as NDJSON")
    log.add_parser("verify", help="verify the hash chain; names the first broken row")
    for parser in (*keys.choices.values(), *log.choices.values(), *_add_users(commands)):
        parser.set_defaults(run=_access)


def _add_users(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
) -> list[argparse.ArgumentParser]:
    users = commands.add_parser("users", help="accounts of people who sign in at the console")
    actions = users.add_subparsers(dest="access", required=True)
    actions.add_parser("list", help="all accounts")
    create = actions.add_parser("create", help="create an account; asks for the password")
    create.add_argument("name", help="of the account")
    create.add_argument("role", help="operator, farmer or admin")
    create.add_argument("--without-password", action="store_true", help="sign in by link only")
    for action, meaning in (
        ("password", "set a new password and end the person's sessions"),
        ("disable", "end the person's sessions and admit no new one"),
        ("enable", "admit the person again"),
        ("delete", "delete an account"),
    ):
        actions.add_parser(action, help=meaning).add_argument("name", help="of the account")
    link = actions.add_parser("link", help="print an address that signs the person in once")
    link.add_argument("name", help="of the account")
    link.add_argument("--role", help="create the account with this role if there is none")
    link.add_argument(
        "--minutes", type=_minutes, default=10.0, help=f"minutes it is valid (to {_WEEK_MIN})"
    )
    return list(actions.choices.values())


if __name__ == "__main__":
    sys.exit(main())
