"""MAVSDK's client flies the autopilot process by streamed setpoints and by sticks."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import pytest
from mavsdk.plugins.action import Action
from mavsdk.plugins.manual_control import ManualControl, ManualControlError
from mavsdk.plugins.offboard import (
    Attitude,
    Offboard,
    OffboardError,
    PositionNedYaw,
    VelocityNedYaw,
)
from mavsdk.plugins.telemetry import FlightMode, Telemetry

from tests.conformance.mavsdk_client import connected
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM = 4
SPEED = 2


class Client(NamedTuple):
    """MAVSDK's plugins on one vehicle."""

    action: Any
    manual: Any
    offboard: Any
    telemetry: Any


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with connected(SYSTEM, SPEED, tmp_path_factory.mktemp("vehicle")) as system:
        made = Client(Action(system), ManualControl(system), Offboard(system), Telemetry(system))
        made.telemetry.set_rate_position_velocity_ned(20.0)
        made.telemetry.set_rate_attitude_euler(20.0)
        wait_for(lambda: all(map(math.isfinite, place(made))), "a position")
        yield made


def place(client: Client) -> tuple[float, float, float]:
    position = client.telemetry.position_velocity_ned().position
    return (position.north_m, position.east_m, position.down_m)


def within(client: Client, wanted: tuple[float, float, float], metres: float) -> bool:
    return math.dist(place(client), wanted) < metres


def mode(client: Client) -> FlightMode:
    return FlightMode(client.telemetry.flight_mode())


@contextmanager
def sticks(client: Client, x: float, y: float, z: float, r: float) -> Iterator[None]:
    """Hold the sticks at about 50 Hz."""
    done = threading.Event()

    def hold() -> None:
        while not done.wait(0.02):
            client.manual.set_manual_control_input(x, y, z, r)

    thread = threading.Thread(target=hold)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def test_offboard_without_a_setpoint_is_refused(client: Client) -> None:
    with pytest.raises(OffboardError):
        client.offboard.start()


def test_take_off_points_and_velocity_by_offboard(client: Client) -> None:
    client.action.arm()
    start = place(client)
    client.offboard.set_position_ned(PositionNedYaw(start[0], start[1], -3.0, 0.0))
    client.offboard.start()
    wait_for(lambda: mode(client) is FlightMode.OFFBOARD, "offboard")
    wait_for(lambda: within(client, (start[0], start[1], -3.0), 0.5), "the take-off")
    client.offboard.set_position_ned(PositionNedYaw(5.0, -5.0, -4.0, 90.0))
    wait_for(lambda: within(client, (5.0, -5.0, -4.0), 0.5), "the point")
    client.offboard.set_velocity_ned(VelocityNedYaw(2.0, 0.0, 0.0, 90.0))
    wait_for(lambda: place(client)[0] > 10.0, "the way north")
    client.offboard.stop()
    wait_for(lambda: mode(client) is FlightMode.HOLD, "hold")


def time_s(client: Client) -> float:
    """The vehicle's own time, whatever the speed of the simulation."""
    return float(client.telemetry.attitude_euler().timestamp_us) / 1e6


def test_five_points_are_each_reached_in_ten_seconds(client: Client) -> None:
    """Within 0.3 m, as a PX4 multicopter does."""
    north, east, _ = place(client)
    client.offboard.set_position_ned(PositionNedYaw(north, east, -4.0, 0.0))
    client.offboard.start()
    wait_for(lambda: within(client, (north, east, -4.0), 0.3), "the first place")
    for to_north, to_east, down in (
        (5.0, 0.0, -4.0),
        (5.0, 5.0, -5.0),
        (0.0, 5.0, -5.0),
        (-3.0, 0.0, -4.0),
        (0.0, 0.0, -4.0),
    ):
        began_s = time_s(client)
        point = (north + to_north, east + to_east, down)
        client.offboard.set_position_ned(PositionNedYaw(*point, 0.0))
        wait_for(partial(within, client, point, 0.3), f"the point {point}")
        assert time_s(client) - began_s < 10.0


def test_a_pitch_of_minus_twenty_degrees_is_held(client: Client) -> None:
    """Within 5 degrees, as a PX4 multicopter does."""
    attitude = client.telemetry.attitude_euler
    client.offboard.set_attitude(Attitude(0.0, -20.0, 0.0, 0.25))
    wait_for(lambda: abs(attitude().pitch_deg + 20.0) < 5.0, "the attitude")
    until_s = time_s(client) + 1.0
    held: list[float] = []

    def over() -> bool:
        held.append(attitude().pitch_deg)
        return time_s(client) > until_s

    wait_for(over, "a second")
    assert max(abs(pitch + 20.0) for pitch in held) < 5.0
    client.offboard.stop()
    wait_for(lambda: mode(client) is FlightMode.HOLD, "hold")


def fly_by_sticks(client: Client, begin: Callable[[], None], flown: FlightMode) -> None:
    """Take a mode and fly 5 m north in it without losing height."""
    with sticks(client, 0.0, 0.0, 0.5, 0.0):
        wait_for(lambda: _started(begin), "the mode")
        wait_for(lambda: mode(client) is flown, "the mode's name")
    start = place(client)
    with sticks(client, 0.6, 0.0, 0.5, 0.0):
        wait_for(lambda: math.dist(place(client)[:2], start[:2]) > 5.0, "5 m by sticks")
    assert abs(place(client)[2] - start[2]) < 1.0


def test_the_sticks_fly_in_position_and_altitude_mode(client: Client) -> None:
    fly_by_sticks(client, client.manual.start_position_control, FlightMode.POSCTL)
    fly_by_sticks(client, client.manual.start_altitude_control, FlightMode.ALTCTL)
    client.action.land()
    wait_for(lambda: not client.telemetry.armed(), "the landing")


def _started(begin: Any) -> bool:
    """Whether the mode is accepted now; before the first sticks arrive it is not."""
    try:
        begin()
    except ManualControlError:
        return False
    return True
