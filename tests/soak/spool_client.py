"""An edge client to be killed: posts numbers and prints each that it would not lose any more.

`python -m tests.soak.spool_client URL FOLDER FIRST`
"""

import sys
import time
from itertools import count
from pathlib import Path
from typing import Final

from mavlink_broker.database import Database
from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.edge.spool import MIB, Spool
from tests.support.spooled_posts import picture, post

KEY_FILE: Final = "broker.key"
SPOOL: Final = "broker"
LANES: Final = ("mission_report", "alarm", "done")
PICTURE_EVERY: Final = 7
PICTURE_BYTES: Final = 20_000
_LOOK_EVERY_S: Final = 0.0005


def client_in(folder: Path, url: str) -> tuple[EdgeClient, Spool]:
    """Start a broker's edge client with the spool that an earlier one has left."""
    spool = Spool(Database(folder / SPOOL), max_bytes=4 * MIB)
    client = EdgeClient(url, folder / KEY_FILE, lambda: None, spool=spool)
    client.start()
    return client, spool


def message(number: int) -> Post:
    """Give the post of a number, in one of three lines."""
    lane = LANES[number % len(LANES)]
    return post(lane, number, urgency=Urgency.ALARM if lane == "alarm" else Urgency.REPORT)


def main(url: str, folder: Path, first: int) -> None:
    """Post until killed; a number is printed once it has been answered or is on the disk."""
    client, spool = client_in(folder, url)
    for number in count(first):
        sent = message(number)
        client.post(sent)
        if number % PICTURE_EVERY == 0:
            client.post(picture(number, PICTURE_BYTES))
        while client.waiting and (sent.spool_number is None or sent.spool_number not in spool):
            time.sleep(_LOOK_EVERY_S)
        sys.stdout.write(f"{number}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))
