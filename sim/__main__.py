"""`python -m sim`: run the whole system; `python -m sim demo`: fly an example plan in it."""

import argparse
import os
import sys

from sim import demo, launcher
from sim.settings import SettingsError, from_environment


def main() -> int:
    """Run; 2 when a setting does not fit."""
    parser = argparse.ArgumentParser(prog="sim", description=__doc__)
    parser.add_argument("what", nargs="?", choices=("run", "demo"), default="run")
    arguments = parser.parse_args()
    try:
        settings = from_environment(os.environ)
    except SettingsError as error:
        print(error, file=sys.stderr)
        return 2
    return demo.run(settings) if arguments.what == "demo" else launcher.run(settings)


if __name__ == "__main__":
    sys.exit(main())
