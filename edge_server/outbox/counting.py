"""What the relay counts for those who watch over it."""

from bisect import bisect_left
from enum import IntEnum
from typing import Final

from edge_server.outbox.answers import Meaning, Verdict
from edge_server.outbox.queue import Parcel
from edge_server.store.tally import Tally

UPLINK: Final = "uplink_state"
DELIVERY_BUCKETS_S: Final = (0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 5, 30, 300, 3600, 86400)
_ALPHABET: Final = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_TIME_DIGITS: Final = 10


class Uplink(IntEnum):
    """How the way to the cloud is; STOPPED is what others say of a relay that is gone."""

    STOPPED = 0
    OPEN = 1
    BLOCKED = 2
    PAUSED = 3


class RelayCounts:
    """The relay's tally in the relay's words."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally

    def uplink(self, state: Uplink) -> None:
        """Say how the way to the cloud is now."""
        self._tally.put(UPLINK, value=state)

    def answered(self, parcel: Parcel, verdict: Verdict, now: float) -> None:
        """Count what the cloud said to a record; `now` is wall clock [s]."""
        kind = parcel.stream.kind
        if verdict.meaning is Meaning.CONFIRMED:
            self._tally.add("fm_delivered", kind)
            self._delivered_after(max(now - made_at_s(parcel.message_id), 0.0))
        elif verdict.meaning is Meaning.REJECTED:
            self._tally.add("fm_rejected", kind, str(verdict.status))
        else:
            reason = verdict.meaning.value.replace(" ", "_")
            status = f"_{verdict.status}" if verdict.status else ""
            self._tally.add("fm_retries", reason + status)

    def _delivered_after(self, delay_s: float) -> None:
        place = bisect_left(DELIVERY_BUCKETS_S, delay_s)
        within = "+Inf" if place == len(DELIVERY_BUCKETS_S) else f"{DELIVERY_BUCKETS_S[place]:g}"
        self._tally.add("fm_delivery_seconds", within)
        self._tally.add("fm_delivery_seconds_sum", amount=delay_s)


def made_at_s(message_id: str) -> float:
    """Time [s since 1970] at which a message id was made: the first 48 bits of a ULID."""
    milliseconds = 0
    for digit in message_id[:_TIME_DIGITS]:
        milliseconds = milliseconds * 32 + _ALPHABET.index(digit)
    return milliseconds / 1000.0
