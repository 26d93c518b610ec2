"""The uplink to the cloud as the relay sees it: parcels out, one reply each.

`HttpUplink` (`edge_server/uplinks/cloud_http.py`) is one; every other one gives its
replies in the same form, a status of HTTP or the reason why there was no answer.

UplinkEndedError  this uplink sends nothing any more; the relay should start again
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

from edge_server.outbox.answers import Answer, Reply
from edge_server.outbox.queue import Parcel


class Offer(NamedTuple):
    """How much may go together in one `send`, at most."""

    records: int
    size_bytes: int


ONE_BY_ONE: Final = Offer(1, 0)
MOST: Final = Offer(100, 256 * 1024)
"""No uplink is given more than this, whatever it offers."""

HELD_BACK: Final = Answer(424)
"""Reply to a parcel that was not sent, since one before it in its stream has to go first."""


class UplinkEndedError(Exception):
    """This uplink sends nothing any more; a new one may."""


class Uplink(Protocol):
    """How records get to the cloud; all methods may be called by several threads at once."""

    def offer(self) -> Offer:
        """How much `send` takes at present; a single record is always taken, of any size."""

    def send(self, parcels: Sequence[Parcel]) -> Sequence[Reply]:
        """Send parcels, those of one stream in their order, and wait: one reply each, in order.

        Never raises for what the network does. The relay has at most one `send` under way per
        stream. After a parcel that has to be tried again, later ones of its stream in the same
        call are not sent but answered with `HELD_BACK`.

        Raises:
            UplinkEndedError: if it can send nothing any more.
        """

    def close(self) -> None:
        """Let go of connections; a `send` under way ends with a reason."""
