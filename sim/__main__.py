"""`python -m sim`: run the whole system; `demo`: fly an example plan in it; `fly`: and report."""

import argparse
import os
import sys
from pathlib import Path

from sim.launch import demo, launcher
from sim.launch.settings import SettingsError, from_environment


def main() -> int:
    """Run; 2 when a setting does not fit."""
    parser = argparse.ArgumentParser(prog="sim", description=__doc__)
    parser.add_argument("what", nargs="?", choices=("run", "demo", "fly"), default="run")
    arguments = parser.parse_args()
    try:
        settings = from_environment(os.environ)
    except SettingsError as error:
        print(error, file=sys.stderr)
        return 2
    if arguments.what == "fly":
        from sim.launch import fly  # noqa: PLC0415  # needs matplotlib, which only developers have

        return fly.run(settings, Path(os.environ.get("OUT") or settings.state_dir / "flight"))
    return demo.run(settings) if arguments.what == "demo" else launcher.run(settings)


if __name__ == "__main__":
    sys.exit(main())
