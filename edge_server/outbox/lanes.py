"""What the schedule keeps of each stream, of each way that may be closed, and what verdicts do."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from edge_server.outbox.answers import Meaning, Verdict
from edge_server.outbox.queue import Parcel, Stream
from edge_server.outbox.states import Happening

PLACE_TRIES: Final = 10  # So many times a kind without a place is tried for each record


@dataclass(slots=True)
class Circuit:
    """Failures in a row, and until when nothing goes; one probe at a time after that."""

    failures: int = 0
    not_before: float = 0.0


@dataclass(slots=True)
class Lane:
    """One stream's records in memory."""

    waiting: deque[Parcel] = field(default_factory=deque)
    flying: list[int] = field(default_factory=list)  # Row ids
    circuit: Circuit = field(default_factory=Circuit)
    read_to: int = 0
    has_more: bool = True


def held_back_behind(parcels: Sequence[Parcel], verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Take "held back" at its word only behind another record of its stream.

    The first one of a stream has nothing before it to wait for: a cloud that answers 424 to it is
    a cloud that does not take it now, and is asked again after a while.
    """
    seen: set[Stream] = set()
    judged = []
    for parcel, verdict in zip(parcels, verdicts, strict=True):
        is_first = parcel.stream not in seen
        seen.add(parcel.stream)
        if is_first and verdict.meaning is Meaning.HELD_BACK:
            reason = "424 to a record with none before it"
            judged.append(verdict._replace(meaning=Meaning.TRY_LATER, reason=reason))
        else:
            judged.append(verdict)
    return judged


def happening_of(parcel: Parcel, verdict: Verdict) -> Happening:
    """What a verdict does to the row of a record that is in flight."""
    if verdict.meaning is Meaning.NO_PLACE and parcel.attempts + 1 >= PLACE_TRIES:
        return Happening.REJECTED
    return _HAPPENING[verdict.meaning]


_HAPPENING: Final = {
    Meaning.CONFIRMED: Happening.CONFIRMED,
    Meaning.TRY_LATER: Happening.PUT_OFF,
    Meaning.NO_CLOUD: Happening.PUT_OFF,
    Meaning.NO_ACCESS: Happening.REFUSED,
    Meaning.REJECTED: Happening.REJECTED,
    Meaning.NO_PLACE: Happening.PUT_OFF,
    Meaning.HELD_BACK: Happening.PUT_OFF,
}
