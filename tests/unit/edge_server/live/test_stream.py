"""A reader receives the complete state and then every change, also after a break."""

import json
import time
from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy.exc import OperationalError

from edge_server.live import watcher as watcher_module
from edge_server.live.changes import Changes
from edge_server.live.farm import NOTHING, Farm, differences
from edge_server.live.stream import HEARTBEAT_S, LiveStream
from edge_server.live.watcher import Watcher

Event = tuple[str, str, Any]


def vehicle(vehicle_id: int, altitude: float = 0.0) -> dict[str, Any]:
    return {"vehicle_id": vehicle_id, "altitude": altitude}


def farm(*vehicles: Mapping[str, Any], **more: Any) -> Farm:
    rows = {row["vehicle_id"]: row for row in vehicles}
    return NOTHING._replace(vehicles=rows, **more)


class Server:
    """Changes and their watcher on a farm that the test sets."""

    def __init__(self, run: str = "a", kept: int = 2000) -> None:
        self.farm = NOTHING
        self.changes = Changes(run, kept)
        self.watcher = Watcher(lambda: self.farm, self.changes)
        self.watcher.look()
        self.is_admitted = True

    def become(self, now: Farm) -> None:
        self.farm = now
        self.watcher.look()

    def read(self, last_id: str = "", vehicle_ids: frozenset[int] | None = None) -> "Reader":
        stream = LiveStream(
            self.changes,
            self.watcher.state,
            vehicle_ids=vehicle_ids,
            last_id=last_id,
            is_admitted=lambda: self.is_admitted,
            note_reader=lambda: None,
        )
        return Reader(stream)


class Reader:
    """Parses the stream as a browser does."""

    def __init__(self, stream: LiveStream) -> None:
        self._stream = stream
        self.last_id = ""
        self.vehicles: dict[int, Any] = {}

    def take(self, now: float = 0.0) -> list[Event]:
        data = self._stream.take(now)
        assert data is not None
        found = []
        for block in data.decode().split("\n\n")[:-1]:
            fields = dict(line.split(": ", 1) for line in block.split("\n") if line != ":")
            if fields:
                self.last_id = fields["id"]
                found.append((fields["id"], fields["event"], json.loads(fields["data"])))
                self._apply(fields["event"], json.loads(fields["data"]))
        return found

    def _apply(self, name: str, data: Any) -> None:
        if name == "snapshot":
            self.vehicles = {row["vehicle_id"]: row for row in data["vehicles"]}
        elif name == "vehicle":
            self.vehicles[data["vehicle_id"]] = data
        elif name == "vehicle_removed":
            del self.vehicles[data["vehicle_id"]]


def test_the_complete_state_comes_first_then_what_changes() -> None:
    server = Server()
    server.become(farm(vehicle(1), vehicle(2)))
    reader = server.read()
    ((_, name, state),) = reader.take()
    assert name == "snapshot"
    assert state["vehicles"] == [vehicle(1), vehicle(2)]
    assert reader.take() == []
    server.become(farm(vehicle(1), vehicle(2, 5.0)))
    ((_, name, row),) = reader.take()
    assert (name, row) == ("vehicle", vehicle(2, 5.0))


def test_a_reader_who_was_away_goes_on_behind_its_last_event() -> None:
    server = Server()
    first = server.read()
    first.take()
    for altitude in (1.0, 2.0, 3.0):
        server.become(farm(vehicle(1, altitude)))
    again = server.read(first.last_id)
    assert [row["altitude"] for _, _, row in again.take()] == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("last_id", ["", "b-1", "a-99", "a-", "x", "a-1-1", "a-" + "9" * 40, "ä"])
def test_a_number_that_is_not_of_this_run_begins_anew(last_id: str) -> None:
    server = Server("a")
    server.become(farm(vehicle(1)))
    ((_, name, _),) = server.read(last_id).take()
    assert name == "snapshot"


def test_a_reader_who_was_away_for_too_long_begins_anew() -> None:
    server = Server(kept=3)
    reader = server.read()
    reader.take()
    for altitude in range(4):
        server.become(farm(vehicle(1, float(altitude))))
    ((_, name, state),) = reader.take()
    assert (name, state["vehicles"]) == ("snapshot", [vehicle(1, 3.0)])


def test_a_heartbeat_comes_while_nothing_changes() -> None:
    server = Server()
    reader = server.read()
    reader.take(0.0)
    stream = reader._stream
    assert stream.take(HEARTBEAT_S - 0.1) == b""
    assert stream.take(HEARTBEAT_S) == b":\n\n"
    assert stream.take(HEARTBEAT_S + 0.1) == b""


def test_a_reader_sees_its_own_vehicles_alone() -> None:
    server = Server()
    mission = {"id": 7, "vehicle_id": 1}
    server.become(farm(vehicle(1), vehicle(2), missions={7: mission}))
    reader = server.read(vehicle_ids=frozenset({2}))
    ((_, _, state),) = reader.take()
    assert (state["vehicles"], state["missions"]) == ([vehicle(2)], [])
    server.become(farm(vehicle(1, 9.0), vehicle(2, 9.0), uplink={"state": "open"}))
    assert [(name, data) for _, name, data in reader.take()] == [
        ("vehicle", vehicle(2, 9.0)),
        ("uplink", {"state": "open"}),
    ]


def test_the_stream_ends_with_the_key_of_its_reader() -> None:
    server = Server()
    reader = server.read()
    reader.take()
    server.is_admitted = False
    assert reader._stream.take(0.0) is None


def test_text_of_a_vehicle_cannot_break_out_of_its_event() -> None:
    server = Server()
    reader = server.read()
    reader.take()
    hostile = vehicle(1) | {"warning": 'x\n\nevent: snapshot\ndata: {}\r\u2028"\\'}
    server.become(farm(hostile))
    ((_, name, row),) = reader.take()
    assert (name, row) == ("vehicle", hostile)


HEIGHTS = st.dictionaries(st.integers(1, 4), st.floats(0, 100), max_size=4)


@given(states=st.lists(HEIGHTS, min_size=1, max_size=12), breaks=st.sets(st.integers(0, 11)))
def test_a_reader_always_ends_with_the_state_of_the_server(
    states: list[dict[int, float]], breaks: set[int]
) -> None:
    server = Server(kept=5)
    reader = server.read()
    for number, state in enumerate(states):
        if number in breaks:  # The connection is lost; the browser connects again
            seen, last_id = reader.vehicles, reader.last_id
            reader = server.read(last_id)
            reader.vehicles, reader.last_id = seen, last_id
        server.become(farm(*(vehicle(one, height) for one, height in state.items())))
        if number % 2:
            reader.take()
    reader.take()
    assert reader.vehicles == dict(server.farm.vehicles)


def test_what_has_not_changed_makes_no_event() -> None:
    state = farm(vehicle(1), missions={7: {"id": 7, "vehicle_id": 1}}, uplink={"state": "open"})
    assert list(differences(state, state)) == []


class TestTheWatcher:
    """Reads while somebody watches, whatever the database does."""

    def test_a_database_that_fails_for_a_time_loses_no_change(self) -> None:
        answers: list[Any] = [
            farm(vehicle(1)),
            OperationalError("", {}, Exception("locked")),
            farm(vehicle(1, 5.0)),
        ]

        def read() -> Farm:
            answer = answers.pop(0)
            if isinstance(answer, Exception):
                raise answer
            return answer  # type: ignore[no-any-return]

        changes = Changes("a")
        watcher = Watcher(read, changes)
        for _ in range(3):
            watcher.look()
        found = changes.after(0)
        assert found is not None
        assert [json.loads(change.event.split(b"data: ")[1]) for change in found] == [
            vehicle(1, 5.0)
        ]

    def test_what_changes_while_nobody_watches_is_not_lost(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(watcher_module, "LINGER_S", 0.0)
        monkeypatch.setattr(watcher_module, "PERIOD_S", 0.01)
        server = Server()
        mission = {"id": 7, "vehicle_id": 1, "dispatch_state": "running"}
        server.become(farm(vehicle(1), missions={7: mission}))
        reader = server.read()
        reader.take()
        watch_until_asleep(server.watcher)
        server.farm = farm(vehicle(1, 5.0))  # The mission ended too long ago to be listed
        watch_until_asleep(server.watcher)
        ((_, name, state),) = server.read(reader.last_id).take()
        assert (name, state["vehicles"], state["missions"]) == ("snapshot", [vehicle(1, 5.0)], [])


def watch_until_asleep(watcher: Watcher) -> None:
    watcher.note_reader()
    while watcher.is_watched:
        time.sleep(0.01)
