"""A vehicle has one broker: a second one gets no work of it, whatever its access key."""

import socket
from typing import Any

import pytest

from edge_server.connections.exchange import Exchange
from edge_server.connections.framing import FramedRequest
from edge_server.services.fleet import broker_work
from edge_server.store.rows.vehicles import CUT_OFF_S, SERVED_S, URGENT_SERVED_S
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import event, mission, plan, telemetry

FIRST, SECOND = "01FIRST", "01SECOND"


class Broker:
    """Requests of one broker."""

    def __init__(self, edge: Edge, instance: str | None, key: str | None = None) -> None:
        self._edge = edge
        self._headers = {"Authorization": f"Bearer {key or edge.key('broker')}"}
        if instance is not None:
            self._headers["Broker-Instance"] = instance

    def ask(self, method: str, path: str, body: Any = None) -> Any:
        return self._edge.client.open(path, method=method, headers=self._headers, json=body)

    def update(self, vehicle_id: int = 1) -> None:
        answer = self.ask("PUT", f"/vehicles/{vehicle_id}", {"link_state": "connected"})
        assert answer.status_code in {200, 201}

    def poll(self, after: int = 0) -> tuple[list[int], int]:
        """Poll for work; gives the ids and the cursor."""
        answer = self.ask("GET", f"/broker/commands?after={after}").json
        return [one["id"] for one in answer["commands"]], answer["cursor"]

    def poll_over(self, exchange: Exchange) -> None:
        """Wait for work as the server does that has this exchange with the client."""
        self._edge.client.open(
            "/broker/commands?after=1&wait=20",
            headers=self._headers,
            environ_overrides={"gunicorn.socket": exchange},
        )

    def accept(self, work_id: int) -> int:
        answer = self.ask("POST", f"/broker/commands/{work_id}/ack", {"status": "accepted"})
        return int(answer.status_code)


@pytest.fixture(params=["two keys", "one key"])
def brokers(edge: Edge, request: pytest.FixtureRequest) -> tuple[Broker, Broker]:
    """Two brokers that hear the same vehicle; the first one was there before."""
    first = Broker(edge, FIRST)
    first.update()
    if request.param == "one key":
        return first, Broker(edge, SECOND)
    made = edge.post("/keys/", {"name": "south", "role": "broker"}, "admin").json or {}
    return first, Broker(edge, None, made["key"])


@BOTH_ENGINES
def test_a_second_broker_gets_no_work_of_the_vehicle(
    edge: Edge, brokers: tuple[Broker, Broker]
) -> None:
    first, second = brokers
    edge.post_plan(plan(mission(1)))
    second.update()
    assert second.poll()[0] == []
    assert first.poll()[0] == [1]
    assert second.accept(1) == 409
    assert first.accept(1) == 200
    assert second.poll()[0] == []
    assert edge.post("/events/", event(), "operator").status_code == 201
    assert second.poll()[0] == []
    assert first.poll(1)[0] == [2]
    assert second.accept(2) == 409
    assert first.accept(2) == 200


def test_its_reports_are_stored_and_the_operator_sees_both(
    edge: Edge, brokers: tuple[Broker, Broker], caplog: pytest.LogCaptureFixture
) -> None:
    first, second = brokers
    assert len(edge.get("/vehicles/1")["brokers"]) == 1
    assert second.ask("POST", "/pose/", telemetry("pose")).status_code == 201
    seen = edge.get("/vehicles/1")["brokers"]
    assert (len(seen), seen[0]) == (2, f"broker/broker {FIRST}")
    assert edge.get("/vehicles/")[0]["brokers"] == seen
    assert "vehicle 1 has two brokers" in caplog.text
    edge.clock.pass_s(SERVED_S)
    first.update()
    assert edge.get("/vehicles/1")["brokers"] == seen[:1]


@BOTH_ENGINES
def test_a_vehicle_goes_to_the_second_broker_once_the_first_is_gone(
    edge: Edge, brokers: tuple[Broker, Broker]
) -> None:
    first, second = brokers
    edge.post_plan(plan(mission(1)))
    assert first.accept(1) == 200
    second.update(7)
    edge.post_plan(plan(mission(2, vehicle_id=7)))
    found, cursor = second.poll()
    assert (found, cursor) == ([2], 2)
    edge.clock.pass_s(SERVED_S)
    found, cursor = second.poll(cursor)
    assert (found, cursor) == ([1, 2], 2)
    assert second.accept(1) == 200
    assert first.accept(1) == 409
    assert first.poll()[0] == []


@BOTH_ENGINES
@pytest.mark.parametrize("kind", [1, 2, 101, 103])
def test_an_order_that_stops_the_flight_passes_to_the_second_broker_sooner(
    edge: Edge, brokers: tuple[Broker, Broker], kind: int
) -> None:
    first, second = brokers
    assert 2.0 * URGENT_SERVED_S <= SERVED_S
    edge.post_plan(plan(mission(1)))
    assert first.accept(1) == 200
    edge.clock.pass_s(URGENT_SERVED_S - 1.0)
    second.update()
    found, cursor = second.poll()
    assert found == []
    assert edge.post("/events/", event(kind), "operator").status_code == 201
    assert second.poll(cursor)[0] == []
    assert second.accept(2) == 409
    edge.clock.pass_s(1.0)
    assert second.poll(cursor)[0] == [2, 1]
    assert second.accept(2) == 200
    assert first.accept(2) == 409
    assert first.poll()[0] == []


def test_other_orders_wait_until_the_first_broker_is_gone(
    edge: Edge, brokers: tuple[Broker, Broker]
) -> None:
    first, second = brokers
    edge.post_plan(plan(mission(1)))
    assert first.accept(1) == 200
    edge.clock.pass_s(SERVED_S - 1.0)
    second.update()
    edge.post("/events/", event(102), "operator")
    assert second.poll()[0] == []


def test_an_order_that_the_first_broker_has_accepted_stays_with_it(
    edge: Edge, brokers: tuple[Broker, Broker]
) -> None:
    first, second = brokers
    edge.post_plan(plan(mission(1)))
    assert edge.post("/events/", event(), "operator").status_code == 201
    assert first.poll()[0] == [2]
    assert first.accept(2) == 200
    edge.clock.pass_s(SERVED_S - 1.0)
    second.update()
    assert second.poll()[0] == []
    assert second.accept(2) == 409


def test_a_poll_that_was_cut_off_ends_the_wait_for_the_first_broker(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(broker_work, "POLL_INTERVAL_S", 0.01)
    first, second = Broker(edge, FIRST), Broker(edge, SECOND)
    first.update()
    second.update()
    edge.post_plan(plan(mission(1)))
    name = f"broker/broker {FIRST}"
    broker_work.poll(edge.context, 1, 20.0, name, is_connected=lambda: False)
    edge.post("/events/", event(), "operator")
    edge.clock.pass_s(CUT_OFF_S - 1.0)
    assert second.poll()[0] == []
    edge.clock.pass_s(1.0)
    assert second.poll()[0] == [2]


def test_a_broker_that_polls_again_was_not_cut_off(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(broker_work, "POLL_INTERVAL_S", 0.01)
    first, second = Broker(edge, FIRST), Broker(edge, SECOND)
    first.update()
    second.update()
    edge.post_plan(plan(mission(1)))
    name = f"broker/broker {FIRST}"

    def polls_meanwhile() -> bool:
        first.poll(1)
        return False

    broker_work.poll(edge.context, 1, 20.0, name, is_connected=polls_meanwhile)
    edge.post("/events/", event(), "operator")
    edge.clock.pass_s(CUT_OFF_S)
    assert second.poll()[0] == []


def test_the_connection_of_a_poll_shows_that_its_broker_is_gone(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(broker_work, "POLL_INTERVAL_S", 0.01)
    first, second = Broker(edge, FIRST), Broker(edge, SECOND)
    first.update()
    second.update()
    edge.post_plan(plan(mission(1)))
    client, server = socket.socketpair()
    with server:
        client.close()
        request = FramedRequest(b"", is_whole=True)
        first.poll_over(Exchange(server, ("192.0.2.1", 5), ("192.0.2.2", 80), request))
    edge.post("/events/", event(), "operator")
    assert second.poll()[0] == []
    edge.clock.pass_s(CUT_OFF_S)
    assert second.poll()[0] == [2]


def test_a_poll_that_waits_keeps_the_vehicle(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(broker_work, "POLL_INTERVAL_S", 0.01)
    first, second = Broker(edge, FIRST), Broker(edge, SECOND)
    first.update()
    second.update()
    edge.post_plan(plan(mission(1)))

    def time_passes() -> bool:
        edge.clock.pass_s(URGENT_SERVED_S - 1.0)
        return True

    name = f"broker/broker {FIRST}"
    broker_work.poll(edge.context, 1, 0.5, name, is_connected=time_passes)
    edge.clock.pass_s(1.0)
    edge.post("/events/", event(), "operator")
    assert second.poll()[0] == []


def test_an_order_that_reaches_no_broker_says_why(edge: Edge) -> None:
    Broker(edge, FIRST).update()
    edge.ask("PUT", "/vehicles/1", "broker", json={"link_state": "connected", "armed": True})
    assert edge.get("/vehicles/1").get("warning") is None
    answer: Any = edge.post("/events/", event(), "operator")
    assert "message" not in answer.json
    edge.clock.pass_s(URGENT_SERVED_S)
    why = f"no broker asks for orders: the last request of broker/broker {FIRST} was at "
    why += "2026-11-21T12:00:00Z"
    assert edge.get("/vehicles/1")["warning"] == why
    answer = edge.post("/events/", event(), "operator")
    assert (answer.status_code, (answer.json or {})["message"]) == (201, why)
    assert edge.get("/events/2")["message"] == why
    assert edge.get("/events/")[-1]["message"] == why
    edge.clock.pass_s(10.0)
    assert edge.get("/events/2")["message"] == f"expired before the broker accepted it; {why}"


def test_an_order_that_waits_for_the_second_broker_says_so(edge: Edge) -> None:
    first, second = Broker(edge, FIRST), Broker(edge, SECOND)
    first.ask("PUT", "/vehicles/1", {"link_state": "connected", "armed": True})
    second.update()
    shown: Any = edge.post("/events/", event(), "operator").json
    why = f"broker/broker {SECOND} gets no orders yet: the last request of broker/broker {FIRST}"
    assert shown["message"].startswith(why)
    assert edge.get("/vehicles/1")["warning"] == shown["message"]


def test_polling_alone_keeps_a_vehicle(edge: Edge, brokers: tuple[Broker, Broker]) -> None:
    first, second = brokers
    edge.post_plan(plan(mission(1)))
    for _ in range(5):
        edge.clock.pass_s(SERVED_S / 2)
        assert first.poll(1)[0] == []
        second.update()
    assert second.poll()[0] == []


def test_of_two_brokers_that_got_a_mission_one_may_accept_it(edge: Edge) -> None:
    first, second = Broker(edge, FIRST), Broker(edge, SECOND)
    edge.register(2)
    edge.post_plan(plan(mission(1)))
    assert first.poll()[0] == second.poll()[0] == [1]
    assert (second.accept(1), first.accept(1)) == (200, 409)


def test_a_broker_that_does_not_state_its_instance_is_known_by_its_key(edge: Edge) -> None:
    edge.register(1)
    edge.post_plan(plan(mission(1)))
    named = Broker(edge, FIRST)
    assert named.poll()[0] == [1]
    assert named.accept(1) == 200
    edge.register(1)
    assert edge.work()[0]["state"] == "accepted"
    assert edge.get("/vehicles/1")["brokers"] == [f"broker/broker {FIRST}"]


@pytest.mark.parametrize("instance", ["a b", "x" * 33, "\u00e9"])
def test_an_instance_is_letters_and_digits(edge: Edge, instance: str) -> None:
    headers = {"Broker-Instance": instance.encode("latin-1").decode("latin-1")}
    answer = edge.ask("GET", "/broker/commands?after=0", "broker", headers=headers)
    assert answer.status_code == 422
