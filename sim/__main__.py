"""Run the whole system; demo: fly an example plan in it; fly: fly a plan and report on it."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import argparse
import os
import sys
from pathlib import Path

from farm_flight_bridge import VERSION, program_name
from sim.launch import demo, launcher
from sim.launch.settings import VARIABLES, SettingsError, from_environment


def main() -> int:
    """Run; 2 when a setting does not fit."""
    launcher.stop_on_signals()
    try:
        return _run()
    except launcher.Stopped:  # Before anything was started
        return 0


def _run() -> int:
    rows = [
        f"  {name:<20}{meaning}" + (f" (default: {default})" if default else "")
        for name, (default, meaning) in VARIABLES.items()
    ]
    parser = argparse.ArgumentParser(
        prog=program_name("sim"),
        description="Run the whole system, or fly a plan in it.",
        epilog="\n".join(
            [
                "settings, as environment variables:",
                *rows,
                "",
                "Exit status: 0 done, or ended by a signal; 1 a mission or a program has failed;",
                "2 a wrong setting.",
            ]
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {VERSION}")
    parser.add_argument(
        "what",
        nargs="?",
        choices=("run", "demo", "fly"),
        default="run",
        help="run: until Ctrl-C; demo: fly a plan and end; fly: fly a plan and report on it",
    )
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
