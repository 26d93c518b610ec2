"""MAVSDK's client, which knows nothing of this project, drives the autopilot process."""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest
from mavsdk import Autopilot
from mavsdk.plugins.action import Action, ActionError, ActionResult
from mavsdk.plugins.info import Info
from mavsdk.plugins.mission_raw import MissionItem, MissionRaw, MissionRawError, MissionRawResult
from mavsdk.plugins.param import Param, ParamError, ParamResult
from mavsdk.plugins.telemetry import FlightMode, LandedState, Telemetry

from tests.conformance.mavsdk_client import connected
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM = 3
SPEED = 5
LATITUDE_E7, LONGITUDE_E7 = 404_434_000, -37_382_000
TAKEOFF, WAYPOINT, RETURN, ORBIT = 22, 16, 20, 34
FENCE_CIRCLE = 5003


class Client(NamedTuple):
    """MAVSDK's plugins on one vehicle."""

    system: Any
    action: Any
    info: Any
    mission: Any
    parameters: Any
    telemetry: Any


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with connected(SYSTEM, SPEED, tmp_path_factory.mktemp("vehicle")) as system:
        made = Client(
            system=system,
            action=Action(system),
            info=Info(system),
            mission=MissionRaw(system),
            parameters=Param(system),
            telemetry=Telemetry(system),
        )
        yield made


def item(seq: int, command: int = WAYPOINT, **fields: Any) -> MissionItem:
    """A mission item, by default a waypoint a few metres from the one before."""
    values: dict[str, Any] = {
        "seq": seq,
        "frame": 6,
        "command": command,
        "current": int(seq == 0),
        "autocontinue": 1,
        "param1": 0.0,
        "param2": 0.0,
        "param3": 0.0,
        "param4": math.nan,
        "x": LATITUDE_E7 + 500 * seq,
        "y": LONGITUDE_E7 + 300 * seq,
        "z": 10.0,
        "mission_type": 0,
    }
    return MissionItem(**{**values, **fields})


def as_text(items: list[MissionItem]) -> list[str]:
    """Comparable form of items, in which NaN equals NaN."""
    return [repr(sorted(vars(each).items())) for each in items]


def collected(subscribe: Callable[[Any], Any], into: list[Any]) -> Any:
    return subscribe(lambda value, _user_data=None: into.append(value))


def test_the_vehicle_is_a_px4_of_a_version_that_is_no_release(client: Client) -> None:
    assert client.system.get_system_id() == SYSTEM
    assert client.system.autopilot_type() == Autopilot.PX4
    version = client.info.get_version()
    assert (version.flight_sw_major, version.flight_sw_minor, version.flight_sw_patch) == (1, 16, 0)
    assert client.info.get_identification().legacy_uid == SYSTEM


def test_the_vehicle_on_the_ground_is_seen_unprompted(client: Client) -> None:
    telemetry = client.telemetry
    wait_for(telemetry.health_all_ok, "a healthy vehicle")
    wait_for(lambda: telemetry.position().latitude_deg > 0.0, "the position")
    wait_for(lambda: abs(telemetry.attitude_euler().roll_deg) < 90.0, "the attitude")
    wait_for(lambda: FlightMode(telemetry.flight_mode()) is FlightMode.HOLD, "the mode")
    wait_for(
        lambda: LandedState(telemetry.landed_state()) is LandedState.ON_GROUND, "the landed state"
    )
    wait_for(lambda: telemetry.battery().remaining_percent > 0.0, "the battery")
    wait_for(lambda: telemetry.unix_epoch_time() > 0, "the time")
    wait_for(lambda: telemetry.gps_info().fix_type >= 3, "the receiver")
    wait_for(lambda: telemetry.home().absolute_altitude_m > 0.0, "home")
    position = telemetry.position()
    assert position.latitude_deg == pytest.approx(40.4434, abs=1e-4)
    assert position.longitude_deg == pytest.approx(-3.7382, abs=1e-4)
    assert position.relative_altitude_m == pytest.approx(0.0, abs=2.0)
    assert telemetry.home().absolute_altitude_m == pytest.approx(650.0, abs=10.0)
    assert abs(telemetry.attitude_euler().roll_deg) < 10.0
    assert telemetry.battery().remaining_percent == pytest.approx(100.0, abs=5.0)
    assert not telemetry.armed()


def test_the_truth_is_streamed_when_asked_for(client: Client) -> None:
    client.telemetry.set_rate_ground_truth(15.0)
    truth = wait_for(
        lambda: t if (t := client.telemetry.ground_truth()).timestamp_us > 0 else None, "the truth"
    )
    assert truth.latitude_deg == pytest.approx(40.4434, abs=1e-4)


def test_parameters_are_read_set_listed_and_guarded(client: Client) -> None:
    parameters = client.parameters
    parameters.set_param_float("MIS_TAKEOFF_ALT", 5.5)
    assert parameters.get_param_float("MIS_TAKEOFF_ALT") == 5.5
    assert client.action.get_takeoff_altitude() == 5.5
    parameters.set_param_int("NAV_DLL_ACT", 1)
    assert parameters.get_param_int("NAV_DLL_ACT") == 1
    parameters.set_param_int("NAV_DLL_ACT", 0)
    every = parameters.get_all_params()
    assert {"MIS_TAKEOFF_ALT", "MPC_XY_VEL_MAX"} <= {p.name for p in every.float_params}
    assert "NAV_DLL_ACT" in {p.name for p in every.int_params}
    with pytest.raises(ParamError) as refused:
        parameters.set_param_int("NAV_DLL_ACT", 77)
    assert refused.value.args[0] == ParamResult.VALUE_OUT_OF_RANGE
    with pytest.raises(ParamError) as unknown:
        parameters.get_param_float("NO_SUCH_PARAM")
    assert unknown.value.args[0] == ParamResult.DOES_NOT_EXIST


def test_a_parameter_is_set_right_behind_refused_ones(client: Client) -> None:
    """MAVSDK takes a value that comes during its next request for the answer to that."""
    action = client.action
    for height_m in (8.0, 5.0) * 4:
        for refused in (math.nan, 1e5, -1.0):
            with pytest.raises(ActionError) as error:
                action.set_takeoff_altitude(refused)
            assert error.value.args[0] == ActionResult.PARAMETER_ERROR
        action.set_takeoff_altitude(height_m)
        assert action.get_takeoff_altitude() == height_m


def test_a_mission_of_100_items_comes_down_as_it_went_up(client: Client) -> None:
    items = [item(0, TAKEOFF), *(item(seq) for seq in range(1, 100))]
    client.mission.upload_mission(items)
    assert as_text(client.mission.download_mission()) == as_text(items)


def test_an_unflyable_mission_is_refused_and_the_old_one_kept(client: Client) -> None:
    items = [item(0, TAKEOFF), item(1)]
    client.mission.upload_mission(items)
    with pytest.raises(MissionRawError) as refused:
        client.mission.upload_mission([item(0, TAKEOFF), item(1, ORBIT)])
    assert refused.value.args[0] == MissionRawResult.UNSUPPORTED
    assert as_text(client.mission.download_mission()) == as_text(items)


def test_a_fence_comes_back_as_it_was_sent_and_outlives_one_that_is_refused(
    client: Client,
) -> None:
    circle = item(0, FENCE_CIRCLE, param1=80.0, param4=0.0, z=0.0, mission_type=1)
    client.mission.upload_geofence([circle])
    impossible = item(0, FENCE_CIRCLE, param1=-5.0, param4=0.0, z=0.0, mission_type=1)
    with pytest.raises(MissionRawError):
        client.mission.upload_geofence([impossible])
    (kept,) = client.mission.download_geofence()
    assert (kept.command, kept.param1, kept.x, kept.y) == (
        FENCE_CIRCLE,
        80.0,
        LATITUDE_E7,
        LONGITUDE_E7,
    )


def test_a_mission_can_be_cleared(client: Client) -> None:
    client.mission.upload_mission([item(0, TAKEOFF), item(1)])
    client.mission.clear_mission()
    assert client.mission.download_mission() == []


def test_a_command_that_cannot_be_executed_is_refused(client: Client) -> None:
    with pytest.raises(ActionError):
        client.action.goto_location(40.4435, -3.7382, 660.0, math.nan)
    with pytest.raises(ActionError):
        client.action.set_current_speed(3.0)
    with pytest.raises(ActionError):
        client.action.transition_to_fixedwing()


def test_a_mode_of_the_air_is_chosen_on_the_ground_but_not_armed_in(client: Client) -> None:
    telemetry, action = client.telemetry, client.action
    action.land()
    wait_for(lambda: FlightMode(telemetry.flight_mode()) is FlightMode.LAND, "the mode")
    with pytest.raises(ActionError):
        action.arm()
    action.hold()
    wait_for(lambda: FlightMode(telemetry.flight_mode()) is FlightMode.HOLD, "hold")


def test_take_off_hold_and_land(client: Client) -> None:
    telemetry, action = client.telemetry, client.action
    modes: list[Any] = []
    handle = collected(telemetry.subscribe_flight_mode, modes)
    action.set_takeoff_altitude(5.0)
    action.arm()
    wait_for(telemetry.armed, "armed")
    action.takeoff()
    wait_for(lambda: telemetry.position().relative_altitude_m > 4.5, "5 m height")
    assert telemetry.in_air()
    wait_for(lambda: FlightMode(telemetry.flight_mode()) is FlightMode.HOLD, "hold after take-off")
    action.land()
    wait_for(lambda: not telemetry.armed(), "disarmed")
    assert LandedState(telemetry.landed_state()) is LandedState.ON_GROUND
    telemetry.unsubscribe_flight_mode(handle)
    assert {FlightMode.TAKEOFF, FlightMode.HOLD, FlightMode.LAND} <= {FlightMode(m) for m in modes}


def test_a_mission_is_flown_and_its_progress_seen(client: Client) -> None:
    telemetry, mission = client.telemetry, client.mission
    progress: list[Any] = []
    handle = collected(mission.subscribe_mission_progress, progress)
    mission.upload_mission(
        [
            item(0, TAKEOFF),
            item(1),
            item(2),
            item(3, RETURN, frame=2, param4=0.0, x=0, y=0, z=0.0),
        ]
    )
    client.action.arm()
    mission.start_mission()
    wait_for(lambda: FlightMode(telemetry.flight_mode()) is FlightMode.MISSION, "mission mode")
    wait_for(lambda: telemetry.position().relative_altitude_m > 9.0, "10 m height")
    wait_for(lambda: not telemetry.armed(), "home again")
    mission.unsubscribe_mission_progress(handle)
    position, home = telemetry.position(), telemetry.home()
    assert position.latitude_deg == pytest.approx(home.latitude_deg, abs=3e-5)
    assert position.longitude_deg == pytest.approx(home.longitude_deg, abs=3e-5)
    current = [p.current for p in progress]
    assert current == sorted(current)
    assert {0, 1, 2, 3} <= set(current)
    assert {p.total for p in progress} == {4}
