"""What the complete state of the farm contains, and for how long."""

from edge_server.live.reading import RECENT_S, reader
from tests.unit.edge_server.archive.flown import send
from tests.unit.edge_server.conftest import Edge


def alarms(edge: Edge) -> dict[int, bool]:
    """Each alarm of the state, and whether it is open."""
    rows = reader(edge.context)().alarms.values()
    return {row["id"]: row["acknowledged_at"] is None for row in rows}


def test_an_alarm_stays_until_ten_minutes_after_its_acknowledgement(edge: Edge) -> None:
    """A badge counts the open ones, and another reader learns that one is not open any more."""
    send(edge, "alarm")
    send(edge, "alarm")
    edge.clock.pass_s(10.0 * RECENT_S)
    assert alarms(edge) == {1: True, 2: True}
    assert edge.ask("POST", "/alarms/history/1/acknowledge", "operator").status_code == 200
    edge.clock.pass_s(RECENT_S - 1.0)
    assert alarms(edge) == {1: False, 2: True}
    edge.clock.pass_s(2.0)
    assert alarms(edge) == {2: True}
