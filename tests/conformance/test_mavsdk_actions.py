"""MAVSDK's actions and failure injection, and the tolerances that a PX4 multicopter meets."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from mavsdk.plugins.action import ActionError, ActionResult, OrbitYawBehavior
from mavsdk.plugins.failure import Failure, FailureError, FailureResult, FailureType, FailureUnit
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import FlightMode, LandedState

from tests.conformance.mavsdk_client import Pilot, connected, place
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM = 8
SPEED = 5


class Client(NamedTuple):
    """MAVSDK's plugins on one vehicle."""

    pilot: Pilot
    system: Any
    action: Any
    parameters: Any


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with connected(SYSTEM, SPEED, tmp_path_factory.mktemp("vehicle")) as system:
        pilot = Pilot(system)
        yield Client(pilot, system, pilot.action, Param(system))


@pytest.fixture
def flying(client: Client) -> Iterator[Client]:
    """The client with its vehicle in the air; it is on the ground again afterwards."""
    client.pilot.take_off()
    yield client
    client.pilot.land()


def amsl_m(client: Client, height_m: float) -> float:
    """Altitude of a height above home."""
    return float(client.pilot.telemetry.home().absolute_altitude_m) + height_m


def test_a_disarmed_vehicle_arms_and_disarms(client: Client) -> None:
    client.action.arm()
    wait_for(client.pilot.telemetry.armed, "armed")
    client.action.disarm()
    wait_for(lambda: not client.pilot.telemetry.armed(), "disarmed")


def test_a_vehicle_is_killed_on_the_ground(client: Client) -> None:
    client.action.arm()
    client.action.kill()
    wait_for(lambda: not client.pilot.telemetry.armed(), "disarmed")


def test_a_take_off_is_reached_and_held(client: Client) -> None:
    """10 m within 0.35 m in 30 s, then held within 0.25 m for 60 s."""
    pilot = client.pilot
    began_s = pilot.time_s
    pilot.take_off(10.0)
    wait_for(lambda: abs(pilot.height_m - 10.0) < 0.35, "10 m height")
    assert pilot.time_s - began_s < 30.0
    settled = pilot.watch(3.0, lambda: pilot.height_m)[-1]
    assert settled == pytest.approx(10.0, abs=0.35)
    held = pilot.watch(60.0, lambda: pilot.height_m)
    assert max(held) - min(held) < 2 * 0.25
    began_s = pilot.time_s
    pilot.land()
    assert pilot.time_s - began_s < 180.0


def test_a_place_50_m_away_is_reached_and_held(flying: Client) -> None:
    """Within 2 m in 60 s, then within 2 m for 10 s, looking in the ordered direction."""
    pilot = flying.pilot
    began_s = pilot.time_s
    flying.action.goto_location(*place(40.0, 30.0), amsl_m(flying, 10.0), 90.0)
    wait_for(lambda: pilot.distance_m(40.0, 30.0) < 2.0, "the place")
    assert pilot.time_s - began_s < 60.0
    pilot.watch(3.0, lambda: pilot.height_m)  # The height and the heading are reached too
    away = pilot.watch(10.0, lambda: pilot.distance_m(40.0, 30.0))
    assert max(away) < 2.0
    assert pilot.height_m == pytest.approx(10.0, abs=0.5)
    assert pilot.telemetry.attitude_euler().yaw_deg == pytest.approx(90.0, abs=5.0)
    assert pilot.mode is FlightMode.HOLD


def test_a_change_of_speed_is_kept(flying: Client) -> None:
    """2 m/s gives at most 2.5 m/s from 4 s on."""
    pilot = flying.pilot
    flying.action.goto_location(*place(-60.0, 0.0), amsl_m(flying, 8.0), math.nan)
    flying.action.set_current_speed(2.0)
    pilot.watch(4.0, lambda: pilot.speed_m_s)
    speeds = pilot.watch(6.0, lambda: pilot.speed_m_s)
    assert max(speeds) < 2.5
    assert min(speeds) > 1.0, "it flies on"
    flying.action.hold()
    wait_for(lambda: pilot.speed_m_s < 0.5, "the stop")


@pytest.mark.parametrize("clockwise", [True, False])
def test_an_orbit_has_its_radius_and_its_direction(flying: Client, *, clockwise: bool) -> None:
    pilot = flying.pilot
    centre = pilot.place_m()
    radius_m = 10.0 if clockwise else -10.0
    behaviour = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    flying.action.do_orbit(radius_m, 4.0, behaviour, *place(*centre), amsl_m(flying, 8.0))

    def bearing() -> float:
        north, east = pilot.place_m()
        return math.atan2(east - centre[1], north - centre[0])

    wait_for(lambda: abs(pilot.distance_m(*centre) - 10.0) < 0.5, "the circle")
    wait_for(lambda: pilot.speed_m_s > 3.0, "the speed")
    pilot.watch(3.0, bearing)
    bearings = pilot.watch(4.0, bearing)
    away = pilot.watch(4.0, lambda: pilot.distance_m(*centre))
    assert max(abs(distance - 10.0) for distance in away) < 1.0
    turned = (bearings[-1] - bearings[0]) % (2 * math.pi)
    assert (turned < math.pi) == clockwise
    inwards = math.degrees(bearing()) + 180.0
    yaw_error = (pilot.telemetry.attitude_euler().yaw_deg - inwards + 180.0) % 360.0 - 180.0
    assert abs(yaw_error) < 25.0


def test_an_orbit_beyond_the_limits_is_denied_and_nothing_moves(flying: Client) -> None:
    here = flying.pilot.place_m()
    behaviour = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    with pytest.raises(ActionError) as refused:
        flying.action.do_orbit(100_000.0, 4.0, behaviour, *place(*here), amsl_m(flying, 8.0))
    assert refused.value.args[0] == ActionResult.COMMAND_DENIED
    away = flying.pilot.watch(3.0, lambda: flying.pilot.distance_m(*here))
    assert max(away) < 1.0


def test_a_return_climbs_and_lands_at_home(client: Client) -> None:
    """From 40 m away, within 5 m of home, disarmed within 90 s."""
    pilot = client.pilot
    pilot.take_off()
    north_m, east_m = pilot.place_m()
    client.action.goto_location(*place(north_m, east_m + 40.0), amsl_m(client, 8.0), math.nan)
    wait_for(lambda: pilot.from_home_m() > 38.0, "the place")
    client.action.set_return_to_launch_altitude(15.0)
    assert client.action.get_return_to_launch_altitude() == 15.0
    began_s = pilot.time_s
    client.action.return_to_launch()
    wait_for(lambda: pilot.mode is FlightMode.RETURN_TO_LAUNCH, "return")
    wait_for(lambda: pilot.height_m > 14.0, "the height of the return")
    wait_for(lambda: not pilot.telemetry.armed(), "the landing")
    assert pilot.time_s - began_s < 90.0
    assert pilot.from_home_m() < 5.0
    wait_for(
        lambda: LandedState(pilot.telemetry.landed_state()) is LandedState.ON_GROUND, "on ground"
    )


def test_home_is_set_here_and_at_a_place(client: Client) -> None:
    pilot = client.pilot
    north_m, east_m = pilot.place_m()
    altitude_m = pilot.telemetry.home().absolute_altitude_m
    client.action.set_home(False, *place(north_m + 30.0, east_m), altitude_m)
    wait_for(lambda: abs(pilot.from_home_m() - 30.0) < 2.0, "home at the place")
    assert pilot.telemetry.home().absolute_altitude_m == pytest.approx(altitude_m, abs=0.1)
    client.action.set_home(True, math.nan, math.nan, math.nan)
    wait_for(lambda: pilot.from_home_m() < 2.0, "home here")


def test_a_failure_is_injected_only_when_that_is_allowed(client: Client) -> None:
    """MAVSDK reads SYS_FAILURE_EN when its plugin is made."""
    telemetry = client.pilot.telemetry
    gps, off = FailureUnit.SENSOR_GPS, FailureType.OFF
    with pytest.raises(FailureError) as refused:
        Failure(client.system).inject(gps, off, 0)
    assert refused.value.args[0] in {FailureResult.DISABLED, FailureResult.DENIED}
    client.parameters.set_param_int("SYS_FAILURE_EN", 1)
    allowed: Any = wait_for(lambda: injecting(client, gps, off), "a failure that is allowed")
    wait_for(lambda: not telemetry.health_all_ok(), "the loss of the position")
    allowed.inject(gps, FailureType.OK, 0)
    wait_for(telemetry.health_all_ok, "the position again")
    client.parameters.set_param_int("SYS_FAILURE_EN", 0)


def injecting(client: Client, unit: FailureUnit, kind: FailureType) -> Any:
    """MAVSDK's plugin once it has injected something; None while it does not know that it may."""
    failure = Failure(client.system)
    try:
        failure.inject(unit, kind, 0)
    except FailureError:
        return None
    return failure
