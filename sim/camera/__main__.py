"""`python -m sim.camera`: the darkroom's process. A line with an order in, a line with its end out.

It gives way to the flight, which runs in real time, and ends with its standard input.
"""

import json
import os
import signal
import sys
from typing import Final

from sim.camera.develop import Stored, develop
from sim.camera.order import Frame, from_line
from sim.camera.studio import Studio

_NICENESS: Final = 5


def main() -> int:
    """Develop until there are no more orders."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # The vehicle decides when it ends
    os.nice(_NICENESS)
    studio = Studio()
    for line in sys.stdin:
        order = from_line(line)
        stored, reason = Stored(0, 0), ""
        try:
            stored = studio.take(order) if isinstance(order, Frame) else develop(order)
        except OSError as error:
            reason = error.strerror or str(error)
        answer = {"number": order.number, **stored._asdict(), "error": reason}
        if not _told(json.dumps(answer)):
            break
    studio.close()
    return 0


def _told(line: str) -> bool:
    """Whether somebody still listens; the vehicle may have been killed."""
    try:
        print(line, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # For the last flush
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
