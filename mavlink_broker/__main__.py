"""`python -m mavlink_broker`: the broker as a program, and what it can do without flying."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import os
import sys
from datetime import UTC, datetime

from mavlink_broker.cli import dead_letters, fly, run, translate, vehicles
from mavlink_broker.cli.program import MISUSED, UsageError
from mavlink_broker.live.follow_target import TargetSourceError


def main() -> int:
    """Do what was asked for; gives the exit status."""
    subcommand, *rest = sys.argv[1:] or ["run"]
    try:
        return _do(subcommand, rest)
    except UsageError as error:
        print(f"mavlink_broker: {error}", file=sys.stderr)
        return error.status
    except TargetSourceError as error:
        print(f"mavlink_broker: {error}", file=sys.stderr)
        return MISUSED


def _do(subcommand: str, rest: list[str]) -> int:
    """Run a subcommand; arguments without one serve the edge server."""
    match subcommand:
        case "translate":
            return translate.run(rest, datetime.now(UTC))
        case "vehicles":
            return vehicles.run(rest, os.environ)
        case "fly":
            return fly.run(rest, os.environ)
        case "dead-letters":
            return dead_letters.run(rest, os.environ)
        case "run":
            return run.run(rest, os.environ)
        case _:
            return run.run([subcommand, *rest], os.environ)


if __name__ == "__main__":
    sys.exit(main())
