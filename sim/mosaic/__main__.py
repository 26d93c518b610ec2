"""`python -m sim.mosaic FOLDER MAP.jpg`: lay the pictures of a folder on one map."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import argparse
import sys
from pathlib import Path

from sim.mosaic.folder import pictures_in, write_mosaic
from sim.world.farm import Farm


def main() -> int:
    """Write the map; 1 when there is nothing to lay."""
    parser = argparse.ArgumentParser(
        prog="sim.mosaic", description="Lay the pictures of a flight on one map."
    )
    parser.add_argument("folder", type=Path, help="folder with the pictures of a flight")
    parser.add_argument("map", type=Path, help="JPEG to write")
    arguments = parser.parse_args()
    try:
        sheet = write_mosaic(list(pictures_in(arguments.folder)), Farm(), arguments.map)
    except OSError as error:
        print(f"no map: {error}", file=sys.stderr)
        return 1
    if sheet is None:
        print(f"no map: no picture in {arguments.folder} looks down", file=sys.stderr)
        return 1
    many = "picture" if sheet.pictures == 1 else "pictures"
    print(f"{sheet.path}: {sheet.pictures} {many}, {sheet.shown_ha:.2f} ha")
    for field, share in sheet.fields:
        print(f"{field}: {share:.1%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
