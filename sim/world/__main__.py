"""`python -m sim.world`: print the default farm as GeoJSON."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import json
import sys

from sim.world.farm import Farm
from sim.world.geojson import farm_geojson


def main() -> int:
    """Print it."""
    print(json.dumps(farm_geojson(Farm())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
