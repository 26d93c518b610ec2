"""What a ground station hears unprompted, from the first frame on, over vehicle time."""

import itertools
import math
from collections import Counter
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import development as mavlink

from tests.conformance.lockstep import Lockstep

VEHICLE = 5
NAN = math.nan
TAKEOFF, ARM = 22, 400
BOOTING_S, CLIMBING_S, LISTENING_S = 12.0, 13.0, 60.0

RATES_HZ = {
    "HEARTBEAT": 2, "ALTITUDE": 1, "ATTITUDE": 15, "ATTITUDE_QUATERNION": 10, "ATTITUDE_TARGET": 2,
    "AVAILABLE_MODES": 0.3, "AVAILABLE_MODES_MONITOR": 0.3, "BATTERY_STATUS": 0.5,
    "CURRENT_MODE": 0.5, "ESTIMATOR_STATUS": 0.5, "EXTENDED_SYS_STATE": 1,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": 5, "GIMBAL_MANAGER_STATUS": 0.5, "GLOBAL_POSITION_INT": 5,
    "GPS_GLOBAL_ORIGIN": 1, "GPS_RAW_INT": 5, "HOME_POSITION": 0.5, "LOCAL_POSITION_NED": 1,
    "NAV_CONTROLLER_OUTPUT": 1, "PING": 0.1, "POSITION_TARGET_GLOBAL_INT": 1,
    "POSITION_TARGET_LOCAL_NED": 1.5, "RC_CHANNELS": 5, "SCALED_PRESSURE": 1,
    "SERVO_OUTPUT_RAW": 1, "SYS_STATUS": 1, "VFR_HUD": 4, "VIBRATION": 0.1, "WIND_COV": 0.5,
}  # fmt: skip
"""PX4's on the link of a ground station; an orbit is reported only while there is one.

HEARTBEAT alone comes twice as often: before those of the cameras, and behind them.
"""

UNKNOWN_AS_NAN = {
    "ALTITUDE": {"altitude_terrain", "bottom_clearance"},
    "ESTIMATOR_STATUS": {"hagl_ratio", "tas_ratio", "pos_horiz_accuracy", "pos_vert_accuracy"},
    "NAV_CONTROLLER_OUTPUT": {"nav_roll", "nav_pitch", "aspd_error", "xtrack_error"},
    "WIND_COV": {"var_horiz", "var_vert", "horiz_accuracy", "vert_accuracy", "wind_alt"},
}
"""Fields in which NaN says that nothing measures them, as PX4 sends them."""


class Flight(NamedTuple):
    """The received messages."""

    before: list[Any]  # From the first frame to the hold in the air
    hovering: list[Any]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """A vehicle that boots, takes off and holds."""
    station = Lockstep(VEHICLE, tmp_path_factory.mktemp("vehicle"))
    before = station.run(BOOTING_S)
    for number, parameters in ((TAKEOFF, (NAN,) * 7), (ARM, (1.0, *(0.0,) * 6))):
        message = mavlink.MAVLink_command_long_message(VEHICLE, 1, number, 0, *parameters)
        station.say(message)
        before += station.run(0.5)
    before += station.run(CLIMBING_S)
    assert station.newest["GLOBAL_POSITION_INT"].relative_alt > 2000, "it flies"
    return Flight(before, station.run(LISTENING_S))


def test_each_message_comes_at_px4s_rate(flight: Flight) -> None:
    received = Counter(message.get_type() for message in flight.hovering)
    assert set(RATES_HZ) <= set(received)
    wrong = {
        name: received[name] / LISTENING_S
        for name, rate_hz in RATES_HZ.items()
        if abs(received[name] - rate_hz * LISTENING_S) > max(1.0, 0.1 * rate_hz * LISTENING_S)
    }
    assert wrong == {}


def test_no_number_is_nan_that_a_client_has_to_know(flight: Flight) -> None:
    """MAVProxy formats some as integers and does not survive; from the first frame on."""
    odd = {
        (message.get_type(), name)
        for message in flight.before + flight.hovering
        for name in message.get_fieldnames()
        if isinstance(value := getattr(message, name), float)
        and not math.isfinite(value)
        and name not in UNKNOWN_AS_NAN.get(message.get_type(), ())
    }
    assert odd == set()


def test_the_vehicle_s_time_goes_on_evenly_and_never_back(flight: Flight) -> None:
    stamps = [m.time_boot_ms for m in flight.hovering if m.get_type() == "ATTITUDE"]
    steps = [later - earlier for earlier, later in itertools.pairwise(stamps)]
    assert min(steps) >= 60
    assert max(steps) <= 76


def test_each_frame_is_numbered_without_a_gap(flight: Flight) -> None:
    numbers = [message.get_seq() for message in flight.hovering]
    gaps = Counter((b - a) % 256 for a, b in itertools.pairwise(numbers))
    assert set(gaps) == {1}
