"""The threads that talk to the cloud: each shipment comes back with its verdicts, or it is told."""

import select
from collections.abc import Iterator, Sequence

import pytest

from edge_server.outbox.answers import Answer, Meaning, Reply, Verdict
from edge_server.outbox.crew import Answered, Crew, WorkerDiedError
from edge_server.outbox.queue import Parcel, Stream
from edge_server.outbox.schedule import Shipment
from edge_server.outbox.uplink import ONE_BY_ONE, Offer, UplinkEndedError

PATIENCE_S = 60.0


class Uplink:
    """Confirms records of vehicle 1, rejects others, fails on those of vehicle 0, ends at 9."""

    def offer(self) -> Offer:
        return ONE_BY_ONE

    def send(self, parcels: Sequence[Parcel]) -> list[Reply]:
        if any(parcel.stream.vehicle_id == 0 for parcel in parcels):
            raise RuntimeError("broken")
        if any(parcel.stream.vehicle_id == 9 for parcel in parcels):
            raise UplinkEndedError("gone")
        return [Answer(200 if parcel.stream.vehicle_id == 1 else 422) for parcel in parcels]

    def close(self) -> None:
        """There is no connection."""


@pytest.fixture
def crew() -> Iterator[Crew]:
    """Three threads."""
    crew = Crew(Uplink(), 3)
    crew.start()
    yield crew
    crew.dismiss()


def shipment(*vehicle_ids: int) -> Shipment:
    return Shipment(
        [Parcel(n, n, f"{n:026d}", Stream(of, "pose"), "{}", 0) for n, of in enumerate(vehicle_ids)]
    )


def collect(crew: Crew, number: int) -> list[Answered]:
    """Wait at the bell until so many have been answered."""
    found: list[Answered] = []
    while len(found) < number:
        readable, _, _ = select.select([crew.bell], [], [], PATIENCE_S)
        assert readable
        found += crew.answers()
    return found


def test_each_record_of_a_shipment_gets_its_verdict(crew: Crew) -> None:
    crew.send(shipment(1, 2, 1))
    ((_, verdicts),) = collect(crew, 1)
    meanings = [verdict.meaning for verdict in verdicts]
    assert meanings == [Meaning.CONFIRMED, Meaning.REJECTED, Meaning.CONFIRMED]


def test_every_shipment_comes_back(crew: Crew) -> None:
    sent = [shipment(1) for _ in range(50)]
    for one in sent:
        crew.send(one)
    assert len(collect(crew, 50)) == 50


def test_an_unforeseen_error_puts_off_its_own_stream_and_the_others_go_on(
    crew: Crew, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(5):  # More than there are threads
        crew.send(shipment(0))
    crew.send(shipment(1))
    found: dict[int, list[Verdict]] = {0: [], 1: []}
    for answered in collect(crew, 6):
        found[answered.shipment.parcels[0].stream.vehicle_id] += answered.verdicts
    assert [verdict.meaning for verdict in found[0]] == [Meaning.TRY_LATER] * 5
    assert [verdict.meaning for verdict in found[1]] == [Meaning.CONFIRMED]
    assert "RuntimeError" in found[0][0].reason
    assert "RuntimeError: broken" in caplog.text


def test_an_uplink_that_has_ended_is_reported(crew: Crew, caplog: pytest.LogCaptureFixture) -> None:
    crew.send(shipment(9))
    with pytest.raises(WorkerDiedError):
        collect(crew, 1)
    assert "UplinkEndedError: gone" in caplog.text
