"""States of vehicles that the database has refused."""

from edge_server.services.fleet.unstored_states import UnstoredStates
from edge_server.store.rows.vehicles import StoredVehicle

STORED = StoredVehicle(1, {"altitude": 1.0}, 50.0, 100.0)
REFUSED = StoredVehicle(1, {"altitude": 2.0}, 50.0, 90.0)  # The clock was set back


def test_a_refused_state_is_the_newest_until_another_is_stored() -> None:
    states = UnstoredStates()
    assert states.newest(STORED) == STORED
    states.keep(REFUSED, STORED)
    assert states.newest(STORED) == REFUSED
    by_another_server = STORED._replace(updated_at=101.0)
    assert states.newest(by_another_server) == by_another_server
    states.forget(1)
    assert states.newest(STORED) == STORED


def test_each_vehicle_has_its_own() -> None:
    states = UnstoredStates()
    states.keep(REFUSED, STORED)
    other = STORED._replace(vehicle_id=2)
    assert states.newest(other) == other
    states.forget(2)
    assert states.newest(STORED) == REFUSED
