"""A MAVSDK client on the ground-station port while the broker flies a mission."""

from pathlib import Path
from typing import Any

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.telemetry import FlightMode, Telemetry

from tests.support.system import FarmSystem, example_plan, wait_for

pytestmark = pytest.mark.scenario


def test_a_mavsdk_client_sees_the_mission_that_the_broker_flies(tmp_path: Path) -> None:
    seen: dict[str, list[Any]] = {
        name: [] for name in ("position", "attitude", "battery", "mode", "armed", "progress")
    }

    def note(name: str) -> Any:
        return lambda value, _user_data=None: seen[name].append(value)

    with FarmSystem(tmp_path / "var", speed=2.0) as system:
        client = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
        client.add_any_connection(f"udpin://0.0.0.0:{system.settings.gcs_port}")
        system.start().wait_until_connected()
        vehicle = wait_for(lambda: client.first_autopilot(timeout_s=5.0), "MAVSDK's discovery")
        telemetry = Telemetry(vehicle)
        mission = MissionRaw(vehicle)
        telemetry.subscribe_position(note("position"))
        telemetry.subscribe_attitude_euler(note("attitude"))
        telemetry.subscribe_battery(note("battery"))
        telemetry.subscribe_flight_mode(note("mode"))
        telemetry.subscribe_armed(note("armed"))
        mission.subscribe_mission_progress(note("progress"))
        system.fly(example_plan())
        client.destroy()

    heights = [position.relative_altitude_m for position in seen["position"]]
    return_height_m = 20.0
    assert max(heights) == pytest.approx(return_height_m, abs=1.0)
    assert abs(seen["position"][-1].latitude_deg - 40.4434) < 1e-4
    yaws = [attitude.yaw_deg for attitude in seen["attitude"]]
    assert max(yaws) - min(yaws) > 90
    assert all(0 < battery.remaining_percent <= 100 for battery in seen["battery"])
    assert {FlightMode.MISSION} <= {FlightMode(mode) for mode in seen["mode"]}
    assert {True, False} <= {bool(armed) for armed in seen["armed"]}
    currents = [progress.current for progress in seen["progress"]]
    assert currents == sorted(currents)
    assert max(currents) > 4
