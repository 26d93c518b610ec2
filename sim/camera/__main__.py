"""`python -m sim.camera` makes pictures and video: an order per line in, a result per line out.

It runs at lower priority than the flight, and ends with its standard input.
"""

import signal

if __name__ == "__main__":  # The vehicle decides when it ends, also while the rest is loaded
    signal.signal(signal.SIGINT, signal.SIG_IGN)

import json
import os
import sys
from typing import Final

from sim.camera.film.orders import Frame, from_line
from sim.camera.film.picture_file import Stored, write_picture
from sim.camera.film.video_files import VideoFiles

_NICENESS: Final = 5


def main() -> int:
    """Write pictures and videos until there are no more orders."""
    os.nice(_NICENESS)
    videos = VideoFiles()
    for line in sys.stdin:
        order = from_line(line)
        stored, reason = Stored(0, 0), ""
        try:
            stored = videos.take(order) if isinstance(order, Frame) else write_picture(order)
        except OSError as error:
            reason = error.strerror or str(error)
        answer = {"number": order.number, **stored._asdict(), "error": reason}
        if not _answer(json.dumps(answer)):
            break
    videos.close()
    return 0


def _answer(line: str) -> bool:
    """Print an answer; return whether its reader exists: the vehicle may have been killed."""
    try:
        print(line, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # For the last flush
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
