"""Relays that share a database: each stream has one sender, and a dead one is replaced at once."""

from collections.abc import Callable, Iterator

import pytest
from sqlalchemy import Engine, text

from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from edge_server.outbox.streams import RelayStatus, SharedStreams, StreamChanges
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine
from edge_server.store.rows import telemetry
from tests.support.polling import wait_until

pytestmark = pytest.mark.parametrize("engine_name", ["postgresql"], indirect=True)
NOTHING: frozenset[Stream] = frozenset()
Relay = Callable[[], SharedStreams]


@pytest.fixture
def engine(database_url: str) -> Iterator[Engine]:
    """Connections to one database."""
    engine = open_engine(database_url)
    yield engine
    engine.dispose()


@pytest.fixture
def relay(engine: Engine) -> Iterator[Relay]:
    """Make relays; none is left."""
    made: list[SharedStreams] = []

    def make() -> SharedStreams:
        made.append(SharedStreams(engine))
        return made[-1]

    yield make
    for one in made:
        one.close()


def fill(engine: Engine, *streams: Stream) -> None:
    """Make a record due in each."""
    with Database(engine).write() as connection:
        for stream in streams:
            newest = connection.execute(text("SELECT count(*) FROM telemetry")).scalar_one()
            record_id = telemetry.add(
                connection,
                kind=stream.kind,
                vehicle_id=stream.vehicle_id,
                message_id=f"{newest:026d}",
                payload="{}",
                received_at=0.0,
            )
            queue.enqueue(connection, record_id, stream)


def look(
    relay: SharedStreams,
    *,
    now: float = 0.0,
    is_open: bool = True,
    busy: frozenset[Stream] = NOTHING,
) -> StreamChanges:
    return relay.look(RelayStatus(now, is_open, busy, NOTHING))


POSES = [Stream(vehicle_id, "pose") for vehicle_id in range(1, 7)]


def test_one_relay_takes_everything_once(engine: Engine, relay: Relay) -> None:
    fill(engine, *POSES, POSES[0])
    alone = relay()
    assert look(alone).new == set(POSES)
    assert look(alone).new == set()
    fill(engine, POSES[3])
    assert look(alone).new == {POSES[3]}


def test_no_stream_has_two_senders_and_each_relay_has_its_share(
    engine: Engine, relay: Relay
) -> None:
    first, second = relay(), relay()
    look(first), look(second)  # Both publish that they reach the cloud
    fill(engine, *POSES)
    ours, theirs = look(first).new, look(second).new
    assert len(ours) == len(theirs) == 3
    assert not ours & theirs
    assert look(first).gone >= theirs


def test_a_later_relay_gets_idle_streams(engine: Engine, relay: Relay) -> None:
    fill(engine, *POSES)
    first = relay()
    assert look(first).new == set(POSES)
    second = relay()
    look(second)
    busy = frozenset(POSES[:5])
    assert look(first, busy=busy).gone == {POSES[5]}
    assert look(second).new == {POSES[5]}
    look(first)
    assert len(look(second).new) == 2


def test_the_streams_of_a_dead_relay_are_taken_at_the_next_look(
    engine: Engine, relay: Relay
) -> None:
    fill(engine, *POSES)
    first = relay()
    look(first)
    second = relay()
    assert look(second).new == set()
    session = first._session.execute(text("SELECT pg_backend_pid()")).scalar_one()
    with engine.connect() as connection:
        ended = text("SELECT pg_terminate_backend(:session, 30000)")  # Waits until it is gone
        assert connection.execute(ended, {"session": session}).scalar_one()
    assert look(second).new == set(POSES)


def test_a_relay_that_ends_in_order_releases_its_streams(engine: Engine, relay: Relay) -> None:
    fill(engine, *POSES)
    first = relay()
    look(first)
    first.close()
    assert look(relay()).new == set(POSES)


def test_a_blocked_relay_leaves_its_streams_to_one_that_reaches_the_cloud(
    engine: Engine, relay: Relay
) -> None:
    fill(engine, *POSES)
    blocked, through = relay(), relay()
    look(blocked)
    look(through)
    assert look(blocked, is_open=False, now=15.0).gone == set(POSES)
    assert look(through).new == set(POSES)


def test_a_blocked_relay_tries_with_one_stream_from_time_to_time(
    engine: Engine, relay: Relay
) -> None:
    blocked, through = relay(), relay()
    look(through)
    fill(engine, *POSES)
    assert len(look(blocked, is_open=False, now=5.0).new) == 1
    assert len(look(blocked, is_open=False, now=15.0).gone) >= 1


def test_while_all_are_blocked_they_keep_their_streams(engine: Engine, relay: Relay) -> None:
    fill(engine, *POSES)
    first, second = relay(), relay()
    for now in (5.0, 15.0):
        look(first, is_open=False, now=now)
        look(second, is_open=False, now=now)
    first.close()
    # PostgreSQL releases the locks of a session some time after it was closed.
    wait_until(lambda: look(second, is_open=False, now=15.0).new)


def test_urgent_streams_are_taken_first(engine: Engine, relay: Relay) -> None:
    first, second = relay(), relay()
    look(first), look(second)
    urgent = [Stream(1, "alarm"), Stream(2, "mission_report")]
    fill(engine, Stream(1, "image"), Stream(2, "pose"), *urgent)
    assert look(first).new == set(urgent)


def test_a_stream_of_dead_letters_only_is_not_taken(engine: Engine, relay: Relay) -> None:
    fill(engine, POSES[0])
    with engine.begin() as connection:
        connection.execute(text("UPDATE outbox SET state = 'dead', last_error = 'no'"))
    assert look(relay()).new == set()
