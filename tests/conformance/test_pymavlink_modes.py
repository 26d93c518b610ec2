"""How pymavlink's scripts begin, against the autopilot process: `wait_heartbeat`, `set_mode`.

The first returns with the next HEARTBEAT of any component, and knows the vehicle's system id only
if that is the autopilot's. The second takes the newest one of any component for the autopilot's:
with that of a camera it knows neither autopilot nor modes, and raises an error.
"""

import time
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

from tests.conformance.ground_station import vehicle_process
from tests.support.system import free_ports

pytestmark = pytest.mark.scenario

SYSTEM = 5
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def link(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    own, broker, ground = free_ports(3)
    with vehicle_process(SYSTEM, 1, (own, broker, ground), tmp_path_factory.mktemp("vehicle")):
        link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{ground}", source_system=255)
        assert link.wait_heartbeat(timeout=PATIENCE_S) is not None
        yield link
        link.close()


def read_for(link: Any, seconds: float) -> None:
    end_s = time.monotonic() + seconds
    while (left_s := end_s - time.monotonic()) > 0.0:
        link.recv_match(blocking=True, timeout=left_s)


@pytest.mark.parametrize("after_s", [0.1, 0.5, 0.9])
def test_a_script_knows_the_vehicle_after_its_first_heartbeat(link: Any, after_s: float) -> None:
    read_for(link, after_s)
    link.target_system = link.target_component = 0
    heard = link.wait_heartbeat(timeout=PATIENCE_S)
    assert (heard.get_srcComponent(), link.target_system) == (1, SYSTEM)


@pytest.mark.parametrize("after_s", [0.1, 0.35, 0.6, 0.85])
def test_a_mode_is_set_at_any_time(link: Any, after_s: float) -> None:
    while True:
        heard = link.recv_match(type="HEARTBEAT", blocking=True, timeout=PATIENCE_S)
        assert heard is not None
        if heard.get_srcComponent() == 1:
            break
    read_for(link, after_s)
    link.set_mode("LOITER")
    answer = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=PATIENCE_S)
    assert (answer.command, answer.result) == (
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_RESULT_ACCEPTED,
    )
