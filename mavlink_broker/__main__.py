"""`python -m mavlink_broker`: the broker as a program, and what it can do without flying."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Final

from mavlink_broker.cli import dead_letters, fly, run, sign_setup, translate, vehicles
from mavlink_broker.cli.program import MISUSED, UsageError
from mavlink_broker.live.follow_target import TargetSourceError

_COMMANDS: Final[Mapping[str, Callable[[Sequence[str]], int]]] = {
    "run": lambda rest: run.run(rest, os.environ),
    "fly": lambda rest: fly.run(rest, os.environ),
    "translate": lambda rest: translate.run(rest, datetime.now(UTC)),
    "vehicles": lambda rest: vehicles.run(rest, os.environ),
    "sign-setup": lambda rest: sign_setup.run(rest, os.environ),
    "dead-letters": lambda rest: dead_letters.run(rest, os.environ),
}


def main() -> int:
    """Do what was asked for; gives the exit status. Arguments without a command serve."""
    arguments = sys.argv[1:]
    command = arguments.pop(0) if arguments and arguments[0] in _COMMANDS else "run"
    try:
        return _COMMANDS[command](arguments)
    except UsageError as error:
        print(f"mavlink_broker: {error}", file=sys.stderr)
        return error.status
    except TargetSourceError as error:
        print(f"mavlink_broker: {error}", file=sys.stderr)
        return MISUSED


if __name__ == "__main__":
    sys.exit(main())
