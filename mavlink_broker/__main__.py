"""`python -m mavlink_broker`: the broker as a program, and what it can do without flying."""

import os
import sys
from datetime import UTC, datetime

from mavlink_broker.command_line import fly, run, translate, vehicles
from mavlink_broker.command_line.program import UsageError


def main() -> int:
    """Do what the first word asks for; gives the exit status."""
    word, *rest = sys.argv[1:] or ["run"]
    try:
        match word:
            case "translate":
                return translate.run(rest, datetime.now(UTC))
            case "vehicles":
                return vehicles.run(rest, os.environ)
            case "fly":
                return fly.run(rest, os.environ)
            case "run":
                return run.run(rest, os.environ)
            case _:
                return run.run([word, *rest], os.environ)
    except UsageError as error:
        print(f"mavlink_broker: {error}", file=sys.stderr)
        return error.status


if __name__ == "__main__":
    sys.exit(main())
