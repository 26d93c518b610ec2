"""MAVSDK's client points the autopilot's gimbal."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest
from mavsdk.plugins.gimbal import ControlMode, Gimbal, GimbalError, GimbalMode, SendMode
from mavsdk.plugins.telemetry import Telemetry

from tests.conformance.mavsdk_client import connected
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM = 8
SPEED = 5


class Client(NamedTuple):
    """MAVSDK's gimbal plugin on one vehicle."""

    gimbal: Any
    telemetry: Any
    number: int


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with connected(SYSTEM, SPEED, tmp_path_factory.mktemp("vehicle")) as system:
        gimbal, telemetry = Gimbal(system), Telemetry(system)
        (found,) = wait_for(lambda: gimbal.gimbal_list().gimbals, "MAVSDK's discovery")
        yield Client(gimbal, telemetry, found.gimbal_id)


def control(client: Client) -> ControlMode:
    return ControlMode(client.gimbal.get_control_status(client.number).control_mode)


def pointed(client: Client, frame: str) -> Callable[[], tuple[float, float]]:
    """Pitch and yaw [deg], forward or north."""

    def read() -> tuple[float, float]:
        angle = getattr(client.gimbal.get_attitude(client.number), f"euler_angle_{frame}")
        return angle.pitch_deg, angle.yaw_deg

    return read


def wait_to_point(client: Client, frame: str, pitch: float, yaw: float) -> None:
    read = pointed(client, frame)
    wait_for(
        lambda: abs(read()[0] - pitch) < 1.0 and abs(read()[1] - yaw) < 1.0,
        f"{pitch}, {yaw} degrees {frame}",
    )


@pytest.fixture
def in_control(client: Client) -> Client:
    client.gimbal.take_control(client.number, ControlMode.PRIMARY)
    wait_for(lambda: control(client) is ControlMode.PRIMARY, "control of the gimbal")
    return client


def test_the_gimbal_ignores_peers_without_control(client: Client) -> None:
    with pytest.raises(GimbalError):
        client.gimbal.set_angles(
            client.number, 0.0, -30.0, 0.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE
        )


@pytest.mark.parametrize("send", [SendMode.ONCE, SendMode.STREAM])
@pytest.mark.parametrize(
    ("mode", "frame"), [(GimbalMode.YAW_FOLLOW, "forward"), (GimbalMode.YAW_LOCK, "north")]
)
def test_angles_are_reached_in_their_frame(
    in_control: Client, mode: GimbalMode, frame: str, send: SendMode
) -> None:
    yaw = 20.0 if send is SendMode.ONCE else -70.0
    in_control.gimbal.set_angles(in_control.number, 0.0, -35.0, yaw, mode, send)
    wait_to_point(in_control, frame, -35.0, yaw)


def test_rates_turn_it_until_they_are_taken_back(in_control: Client) -> None:
    gimbal, number = in_control.gimbal, in_control.number
    gimbal.set_angles(number, 0.0, -60.0, 0.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE)
    wait_to_point(in_control, "forward", -60.0, 0.0)
    gimbal.set_angular_rates(number, 0.0, 10.0, 5.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE)
    read = pointed(in_control, "forward")
    wait_for(lambda: read()[0] > -50.0 and read()[1] > 5.0, "a gimbal that turns up and right")
    gimbal.set_angular_rates(number, 0.0, 0.0, 0.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE)


def test_the_gimbal_points_at_a_place(client: Client) -> None:
    wait_for(lambda: client.telemetry.position().latitude_deg > 0.0, "the position")
    here = client.telemetry.position()
    east = here.longitude_deg + 100.0 / 84_700.0
    # MAVSDK names a frame with altitudes relative to home.
    client.gimbal.set_roi_location(client.number, here.latitude_deg, east, -50.0)
    read = pointed(client, "north")
    wait_for(lambda: abs(read()[1] - 90.0) < 3.0 and abs(read()[0] + 26.6) < 3.0, "the place")


def test_control_is_given_back(in_control: Client) -> None:
    in_control.gimbal.release_control(in_control.number)
    wait_for(lambda: control(in_control) is ControlMode.NONE, "nobody in control")
