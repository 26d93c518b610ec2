"""The sending threads: each batch comes back with its results, or the error is reported."""

import select
import threading
from collections.abc import Iterator, Sequence

import pytest

from edge_server.outbox.answers import Answer, Outcome, Reply, Result
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.outbox.schedule import Batch
from edge_server.outbox.senders import SenderEndedError, SenderPool, SentBatch
from edge_server.outbox.uplink import ONE_BY_ONE, BatchLimit, UplinkEndedError
from tests.support.descriptors import numbers_given_again, open_channels
from tests.support.polling import wait_until

PATIENCE_S = 60.0


class Uplink:
    """Confirms records of vehicle 1, rejects others, fails on those of vehicle 0, ends at 9."""

    def batch_limit(self) -> BatchLimit:
        return ONE_BY_ONE

    def send(self, records: Sequence[OutboxRecord]) -> list[Reply]:
        if any(record.stream.vehicle_id == 0 for record in records):
            raise RuntimeError("broken")
        if any(record.stream.vehicle_id == 9 for record in records):
            raise UplinkEndedError("gone")
        return [Answer(200 if record.stream.vehicle_id == 1 else 422) for record in records]

    def close(self) -> None:
        """There is no connection."""


@pytest.fixture
def senders() -> Iterator[SenderPool]:
    """Three threads."""
    senders = SenderPool(Uplink(), 3)
    senders.start()
    yield senders
    senders.close()


def batch(*vehicle_ids: int) -> Batch:
    return Batch(
        [
            OutboxRecord(n, n, f"{n:026d}", Stream(of, "pose"), "{}", 0)
            for n, of in enumerate(vehicle_ids)
        ]
    )


def collect(senders: SenderPool, number: int) -> list[SentBatch]:
    """Wait until so many have been sent."""
    found: list[SentBatch] = []
    while len(found) < number:
        readable, _, _ = select.select([senders.descriptor], [], [], PATIENCE_S)
        assert readable
        found += senders.take_sent()
    return found


def test_each_record_of_a_shipment_gets_its_verdict(senders: SenderPool) -> None:
    senders.send(batch(1, 2, 1))
    ((_, results),) = collect(senders, 1)
    outcomes = [result.outcome for result in results]
    assert outcomes == [Outcome.CONFIRMED, Outcome.REJECTED, Outcome.CONFIRMED]


def test_every_shipment_comes_back(senders: SenderPool) -> None:
    sent = [batch(1) for _ in range(50)]
    for one in sent:
        senders.send(one)
    assert len(collect(senders, 50)) == 50


def test_an_unforeseen_error_puts_off_its_own_stream_and_the_others_go_on(
    senders: SenderPool, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(5):  # More than there are threads
        senders.send(batch(0))
    senders.send(batch(1))
    found: dict[int, list[Result]] = {0: [], 1: []}
    for sent in collect(senders, 6):
        found[sent.batch.records[0].stream.vehicle_id] += sent.results
    assert [result.outcome for result in found[0]] == [Outcome.TRY_LATER] * 5
    assert [result.outcome for result in found[1]] == [Outcome.CONFIRMED]
    assert "RuntimeError" in found[0][0].reason
    assert "RuntimeError: broken" in caplog.text


def test_an_uplink_that_has_ended_is_reported(
    senders: SenderPool, caplog: pytest.LogCaptureFixture
) -> None:
    senders.send(batch(9))
    with pytest.raises(SenderEndedError):
        collect(senders, 1)
    assert "UplinkEndedError: gone" in caplog.text


def test_without_threads_a_batch_is_sent_by_the_caller() -> None:
    senders = SenderPool(Uplink(), 0)
    senders.send(batch(1))
    [sent] = senders.take_sent()
    assert [result.outcome for result in sent.results] == [Outcome.CONFIRMED]
    senders.close()


class SlowUplink(Uplink):
    """Confirms nothing before it is released."""

    def __init__(self) -> None:
        self.is_sending, self.may_answer = threading.Event(), threading.Event()
        self.threads: list[threading.Thread] = []

    def send(self, records: Sequence[OutboxRecord]) -> list[Reply]:
        self.threads.append(threading.current_thread())
        self.is_sending.set()
        self.may_answer.wait(PATIENCE_S)
        return super().send(records)


def test_closed_senders_leave_nothing_open_and_an_answer_that_is_late_wakes_nobody() -> None:
    uplink, before = SlowUplink(), open_channels()
    senders = SenderPool(uplink, 1)
    senders.start()
    senders.send(batch(1))
    assert uplink.is_sending.wait(PATIENCE_S)
    senders.close()
    wait_until(lambda: open_channels() <= before)
    with numbers_given_again():
        uplink.may_answer.set()
        uplink.threads[0].join(PATIENCE_S)
        senders.wake()  # As a second signal to end does


def test_a_wake_that_nobody_reads_never_waits(senders: SenderPool) -> None:
    for _ in range(100_000):
        senders.wake()
    assert senders.take_sent() == []
    readable, _, _ = select.select([senders.descriptor], [], [], 0.0)
    assert not readable
