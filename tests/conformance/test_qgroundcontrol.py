"""QGroundControl's connection sequence and guided actions, replayed on a vehicle's process.

That each answer comes in its time is held in `test_qgroundcontrol_actions.py`, in lockstep: here
both ends share a machine with whatever else runs on it.
"""

import math
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mavlink

from tests.conformance.ground_station import GroundStation, vehicle_process
from tests.support.system import free_ports

pytestmark = pytest.mark.scenario

VEHICLE = 4
SPEED = 2.0
NAN = math.nan
ACCEPTED, UNSUPPORTED = 0, 3
REQUEST_MESSAGE, ARM, TAKEOFF, REPOSITION = 512, 400, 22, 192
HOLD, MISSION, RETURN, LAND, TAKING_OFF = (
    0x03040000,
    0x04040000,
    0x05040000,
    0x06040000,
    0x02040000,
)
MODE_BIT, ARMED_BIT = 1, 128


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GroundStation]:
    own, broker, ground = free_ports(3)
    state = tmp_path_factory.mktemp("vehicle")
    made = GroundStation(ground, own, VEHICLE)
    with vehicle_process(VEHICLE, SPEED, (own, broker, ground), state):
        ready = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        made.until(
            lambda m: m.get_type() == "SYS_STATUS" and m.onboard_control_sensors_health & ready,
            "a vehicle that is ready",
        )
        yield made
    made.close()


@pytest.mark.promise
def test_the_connection_sequence_is_answered(station: GroundStation) -> None:
    assert station.command(REQUEST_MESSAGE, 148) == ACCEPTED
    version = station.until(lambda m: m.get_type() == "AUTOPILOT_VERSION", "the version")
    assert version.flight_sw_version >= 0x01040100
    assert station.command(REQUEST_MESSAGE, 435, 0) == ACCEPTED
    mode = station.until(lambda m: m.get_type() == "AVAILABLE_MODES", "the modes")
    station.until(
        lambda m: m.get_type() == "AVAILABLE_MODES" and m.mode_index == mode.number_modes,
        "the last mode",
    )
    assert station.command(REQUEST_MESSAGE, 397) == ACCEPTED
    assert station.command(REQUEST_MESSAGE, 395) == UNSUPPORTED
    read = mavlink.MAVLink_param_request_read_message(VEHICLE, 1, b"_HASH_CHECK", -1)
    first = station.ask(read, "PARAM_VALUE", param_id="_HASH_CHECK")
    values: dict[int, Any] = {}
    station.say(mavlink.MAVLink_param_request_list_message(VEHICLE, 1))

    def complete(message: Any) -> bool:
        if message.get_type() == "PARAM_VALUE":
            values[message.param_index] = message
        return bool(len(values) == first.param_count + 1)

    station.until(complete, "every parameter")
    assert set(values) == {*range(first.param_count), 0xFFFF}
    assert version.capabilities & (16384 | 32768) == 16384 | 32768, "fence and rally"
    for kind in (0, 1, 2):
        plan = mavlink.MAVLink_mission_request_list_message(VEHICLE, 1, kind)
        assert station.ask(plan, "MISSION_COUNT", mission_type=kind).count == 0


def test_the_fly_view_gets_what_it_needs_unprompted(station: GroundStation) -> None:
    needed = {
        "HEARTBEAT", "SYS_STATUS", "EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "GPS_RAW_INT",
        "HOME_POSITION", "ATTITUDE", "VFR_HUD", "ALTITUDE", "BATTERY_STATUS", "MISSION_CURRENT",
        "CURRENT_MODE", "AVAILABLE_MODES_MONITOR",
    }  # fmt: skip
    station.until(lambda _: needed <= set(station.newest), f"all of {sorted(needed)}")


def shows(station: GroundStation, mode: int, *, armed: bool = True) -> None:
    """A heartbeat must show a mode."""
    station.until(
        lambda m: (
            m.get_type() == "HEARTBEAT"
            and m.custom_mode == mode
            and bool(m.base_mode & ARMED_BIT) == armed
        ),
        f"mode {mode:#010x}",
    )


def set_mode(station: GroundStation, mode: int) -> None:
    """What QGroundControl's buttons send: SET_MODE, unanswered, then watch the heartbeat."""
    base = station.newest["HEARTBEAT"].base_mode | MODE_BIT
    station.say(mavlink.MAVLink_set_mode_message(VEHICLE, base, mode))
    shows(station, mode)


def height_m(message: Any) -> float:
    if message.get_type() != "GLOBAL_POSITION_INT":
        return NAN
    return float(message.relative_alt) / 1e3


def test_the_guided_actions(station: GroundStation) -> None:
    station.until(lambda _: "HOME_POSITION" in station.newest, "home")
    home = station.newest["HOME_POSITION"]
    amsl_m = home.altitude / 1e3
    assert station.command(TAKEOFF, -1, 0, 0, NAN, NAN, NAN, amsl_m + 8) == ACCEPTED
    assert station.command(ARM, 1) == ACCEPTED
    shows(station, TAKING_OFF)
    station.until(lambda m: height_m(m) > 7.5, "8 m height")
    station.until(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == HOLD, "hold")

    north = home.latitude + 900
    go_to = (-1, 1, 0, NAN, north, home.longitude, amsl_m + 8)
    assert station.command_int(REPOSITION, 0, *go_to) == ACCEPTED
    shows(station, HOLD)
    station.until(
        lambda m: m.get_type() == "GLOBAL_POSITION_INT" and abs(m.lat - north) < 150, "10 m north"
    )
    assert station.command(REPOSITION, -1, 1, 0, NAN, NAN, NAN, NAN) == ACCEPTED
    assert station.command(REPOSITION, -1, 1, 0, NAN, NAN, NAN, amsl_m + 12) == ACCEPTED
    station.until(lambda m: height_m(m) > 11.5, "12 m height")
    assert station.command(178, 1, 3.0, -1, 0) == ACCEPTED

    set_mode(station, RETURN)
    set_mode(station, HOLD)
    set_mode(station, LAND)
    station.until(lambda m: m.get_type() == "HEARTBEAT" and not m.base_mode & ARMED_BIT, "disarmed")
    assert station.newest["EXTENDED_SYS_STATE"].landed_state == 1


def test_a_reboot_begins_anew(station: GroundStation) -> None:
    before_ms = station.until(lambda m: m.get_type() == "SYSTEM_TIME", "the time").time_boot_ms
    assert station.command(246, 1, 1, 1, 1) == ACCEPTED
    station.until(
        lambda m: m.get_type() == "SYSTEM_TIME" and m.time_boot_ms < before_ms, "a new beginning"
    )
