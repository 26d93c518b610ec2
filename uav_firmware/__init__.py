"""The autopilot: PX4-style modules joined by typed topics."""

import signal
import sys

if sys.argv[:1] == ["-m"]:  # `python -m` loads this before the program: Ctrl-C ends it quietly
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from uav_firmware.compiled import install

install()
