"""Ground stations that know nothing of this project, beside the broker while it flies a mission.

MAVProxy and MAVSDK watch on the forwarding port: they connect, read parameters and the mission,
see the flight, and are refused what would change it. The mission ends as if nobody had been there.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action, ActionError
from mavsdk.plugins.mission_raw import MissionRaw, MissionRawError
from mavsdk.plugins.telemetry import Telemetry
from pymavlink import mavutil

from tests.conformance.mavproxy_session import MavProxy
from tests.support.system import FINISHED, FarmSystem, example_plan, free_ports, wait_for

pytestmark = pytest.mark.scenario


@contextmanager
def mavsdk_at(port: int) -> Iterator[Any]:
    """MAVSDK's system, once it has found it."""
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    sdk.add_any_connection(f"udpout://127.0.0.1:{port}")
    yield wait_for(lambda: sdk.first_autopilot(timeout_s=5.0), "MAVSDK's discovery")
    sdk.destroy()


@pytest.mark.promise
def test_ground_stations_watch_a_mission_and_cannot_disturb_it(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    (tmp_path / "mavproxy").mkdir()
    with FarmSystem(tmp_path / "var", speed=3.0) as system:
        system.environment["FORWARD"] = f"udpin://127.0.0.1:{port}"
        system.start().wait_until_connected()
        with MavProxy(port, tmp_path / "mavproxy", "udpout") as proxy, mavsdk_at(port) as vehicle:
            proxy.until(r"Received \d+ parameters")
            wait_for(Telemetry(vehicle).health_all_ok, "what MAVSDK calls healthy")
            posted = system.post("/plans/", example_plan()).json()
            watch_with_mavsdk(vehicle)
            watch_with_mavproxy(proxy)
            ended = system.wait_until_ended(posted["id"])
        assert [mission["mission_status_id"] for mission in ended["missions"]] == [FINISHED]
        assert "refused to ground stations" in system.log_of("broker")
        assert types_in_log(system.settings.tlog_dir) >= {"COMMAND_LONG", "MISSION_ITEM_INT"}


def watch_with_mavsdk(vehicle: Any) -> None:
    """In the air, the mission can be read; nothing can be ordered."""
    action, mission, telemetry = Action(vehicle), MissionRaw(vehicle), Telemetry(vehicle)
    wait_for(telemetry.in_air, "a vehicle in the air")
    assert len(mission.download_mission()) == 8
    for order in (action.land, action.return_to_launch, action.hold, action.kill):
        with pytest.raises(ActionError):
            order()
    with pytest.raises(MissionRawError, match="DENIED"):
        mission.clear_mission()


def watch_with_mavproxy(proxy: MavProxy) -> None:
    """The same at a prompt; a parameter keeps its value, and what was asked for comes."""
    proxy.ask("disarm", "COMPONENT_ARM_DISARM: TEMPORARILY_REJECTED")
    proxy.ask("wp list", "Saved 8 waypoints")
    proxy.ask("wp clear", "MISSION_ACK: TYPE_MISSION: DENIED")
    proxy.ask("param set MPC_XY_VEL_MAX 1", r"Failed to set .*invalid returned value 12\.0")
    proxy.ask("status GPS_RAW_INT", "satellites_visible")


def types_in_log(folder: Path) -> set[str]:
    """Kinds of messages in the frame log."""
    (path,) = folder.glob("*.tlog")
    log = mavutil.mavlink_connection(str(path), dialect="all")
    found = {message.get_type() for message in iter(log.recv_msg, None)}
    log.close()
    return found
