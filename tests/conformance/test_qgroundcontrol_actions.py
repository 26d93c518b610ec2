"""QGroundControl's requests and guided actions, each held to its time, in vehicle time.

What is sent is what QGroundControl sends to a PX4 multirotor: parameter by parameter.
"""

import math
import struct
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mavlink

from tests.conformance.lockstep import Lockstep

pytestmark = pytest.mark.scenario

VEHICLE = 4
NAN = math.nan
ACCEPTED, UNSUPPORTED = 0, 3
ANSWERED_S = 1.0
SHOWN_S = 1.3
"""How long QGroundControl waits for the heartbeat to show a new mode."""
ARMED_S = 1.5
ARMED, CUSTOM = 128, 1
POSITION, ORBIT, TAKEOFF = 0x00030000, 0x01030000, 0x02040000
HOLD, MISSION, RETURN, LAND, FOLLOW = 0x03040000, 0x04040000, 0x05040000, 0x06040000, 0x08040000
SETUP_PAGES = {
    "AirframeComponentSummary": ("MAV_SYS_ID", "SYS_AUTOSTART", "SYS_AUTOCONFIG"),
    "SensorsComponentSummary": (
        "CAL_MAG0_ID", "CAL_MAG1_ID", "CAL_MAG2_ID", "CAL_GYRO0_ID", "CAL_ACC0_ID",
    ),
    "SensorsSetup": (
        "CAL_MAG0_ROT", "CAL_MAG1_ROT", "CAL_MAG2_ROT", "SENS_BOARD_ROT", "SENS_DPRES_OFF",
    ),
    "PX4RadioComponentSummary": (
        "RC_MAP_ROLL", "RC_MAP_PITCH", "RC_MAP_YAW", "RC_MAP_THROTTLE", "RC_MAP_FLAPS",
        "RC_MAP_AUX1", "RC_MAP_AUX2",
    ),
    "FlightModesComponentSummary": (
        "RC_MAP_FLTMODE", *(f"COM_FLTMODE{slot}" for slot in range(1, 7)),
    ),
    "BatteryParams": (
        "BAT1_SOURCE", "BAT1_N_CELLS", "BAT1_V_CHARGED", "BAT1_V_EMPTY", "BAT1_V_LOAD_DROP",
    ),
    "SafetyComponent": (
        "SDLOG_MODE", "GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST", "RTL_RETURN_ALT",
        "RTL_DESCEND_ALT", "RTL_LAND_DELAY", "COM_LOW_BAT_ACT", "BAT_LOW_THR", "BAT_CRIT_THR",
        "BAT_EMERGEN_THR", "NAV_RCL_ACT", "COM_RC_LOSS_T", "NAV_DLL_ACT", "COM_DL_LOSS_T",
        "COM_DISARM_LAND", "CP_DIST", "COM_OBS_AVOID",
    ),
    "PX4TuningComponentCopterRate": (
        *(f"MC_{axis}RATE_{gain}" for axis in ("ROLL", "PITCH") for gain in "KDI"),
        "MC_YAWRATE_K", "MC_YAWRATE_I",
    ),
    "PX4TuningComponentCopterVelocity": (
        *(f"MPC_{axis}_VEL_{gain}_ACC" for axis in ("XY", "Z") for gain in "PID"),
    ),
}  # fmt: skip
"""What the setup pages for PX4 read with FactPanelController::getParameterFact, by QML file."""
REQUEST, ARM, NAV_TAKEOFF, REPOSITION, DO_ORBIT = 512, 400, 22, 192, 34
SPEED, ROI, ROI_NONE, SET_HOME, SET_CURRENT = 178, 195, 197, 179, 224


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory) -> Lockstep:
    made = Lockstep(VEHICLE, tmp_path_factory.mktemp("vehicle"))
    ready = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    made.until(
        lambda m: m.get_type() == "SYS_STATUS" and m.onboard_control_sensors_health & ready,
        60.0,
        "a vehicle that is ready",
    )
    made.until(lambda m: m.get_type() == "HOME_POSITION", 10.0, "home")
    return made


def is_a(kind: str, **fields: Any) -> Callable[[Any], bool]:
    def check(message: Any) -> bool:
        return message.get_type() == kind and all(
            getattr(message, name) == value for name, value in fields.items()
        )

    return check


def ask(station: Lockstep, message: Any, *answers: Callable[[Any], bool]) -> list[Any]:
    """Say a message; every answer must come within a second."""
    station.say(message)
    left, found = list(answers), []
    deadline_s = station.now_s + ANSWERED_S
    while left and station.now_s < deadline_s:
        for received in station.step():
            for answer in [a for a in left if a(received)]:
                left.remove(answer)
                found.append(received)
    assert not left, f"{message.get_type()} has not got all its answers"
    return found


def long(number: int, *parameters: float, confirmation: int = 0) -> Any:
    padded = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(VEHICLE, 1, number, confirmation, *padded)


def place(number: int, p1: float, p2: float, p3: float, p4: float, *at: float) -> Any:
    """COMMAND_INT in frame 0: latitude and longitude times 1e7, altitude above mean sea level."""
    x, y, z = at
    return mavlink.MAVLink_command_int_message(
        VEHICLE, 1, 0, number, 0, 0, p1, p2, p3, p4, round(x), round(y), z
    )


def command(station: Lockstep, message: Any) -> int:
    """Result of a command's one final answer."""
    (ack,) = ask(station, message, is_a("COMMAND_ACK", command=message.command))
    return int(ack.result)


def shows(station: Lockstep, mode: int, seconds: float = SHOWN_S, *, armed: bool = True) -> None:
    """A heartbeat must show the mode in time."""
    station.until(
        lambda m: is_a("HEARTBEAT", custom_mode=mode)(m) and bool(m.base_mode & ARMED) == armed,
        seconds,
        f"mode {mode:#010x} in HEARTBEAT",
    )


def set_mode(station: Lockstep, mode: int, *, armed: bool = True) -> None:
    """What the buttons send: SET_MODE, which has no answer but the heartbeat."""
    base = station.newest["HEARTBEAT"].base_mode | CUSTOM
    station.say(mavlink.MAVLink_set_mode_message(VEHICLE, base, mode))
    shows(station, mode, armed=armed)


def height_m(message: Any) -> float:
    kind = message.get_type()
    return float(message.relative_alt) / 1e3 if kind == "GLOBAL_POSITION_INT" else NAN


# The connection.


def test_the_version_comes_with_its_acknowledgement(station: Lockstep) -> None:
    version, *_ = sorted(
        ask(station, long(REQUEST, 148), is_a("AUTOPILOT_VERSION"), is_a("COMMAND_ACK", result=0)),
        key=lambda m: str(m.get_type()),
    )
    assert version.flight_sw_version >= 0x01040100, "QGroundControl warns of older ones"
    assert version.flight_sw_version & 0xFF < 255, "an official version would be held outdated"
    assert version.capabilities & (16384 | 32768) == 16384 | 32768, "fence and rally"


def test_the_modes_come_at_once_or_one_by_one(station: Lockstep) -> None:
    station.say(long(REQUEST, 435, 0))
    received = station.run(ANSWERED_S)
    modes = {m.mode_index: m for m in received if m.get_type() == "AVAILABLE_MODES"}
    count = next(iter(modes.values())).number_modes
    assert set(modes) == set(range(1, count + 1))
    for index in range(1, count + 1):
        wanted = is_a("AVAILABLE_MODES", mode_index=index)
        ask(station, long(REQUEST, 435, index), wanted, is_a("COMMAND_ACK", result=0))


def test_component_metadata_is_sent_and_the_deprecated_message_refused(
    station: Lockstep,
) -> None:
    ask(station, long(REQUEST, 397), is_a("COMPONENT_METADATA"), is_a("COMMAND_ACK", result=0))
    assert command(station, long(REQUEST, 395)) == UNSUPPORTED


def test_requests_of_older_versions_are_answered(station: Lockstep) -> None:
    assert command(station, long(519, 1)) == ACCEPTED
    ask(station, long(520, 1), is_a("AUTOPILOT_VERSION"), is_a("COMMAND_ACK", result=0))


def test_the_parameters_come_whole_and_missing_ones_again(station: Lockstep) -> None:
    read = mavlink.MAVLink_param_request_read_message(VEHICLE, 1, b"_HASH_CHECK", -1)
    (known,) = ask(station, read, is_a("PARAM_VALUE", param_id="_HASH_CHECK"))
    station.say(mavlink.MAVLink_param_request_list_message(VEHICLE, 1))
    values = [m.param_index for m in station.run(2.0) if m.get_type() == "PARAM_VALUE"]
    assert values == [0xFFFF, *range(known.param_count)], "the hash first, then each once"
    for index in range(0, known.param_count, 29):
        again = mavlink.MAVLink_param_request_read_message(VEHICLE, 1, b"", index)
        ask(station, again, is_a("PARAM_VALUE", param_index=index))


def test_a_known_hash_ends_the_list(station: Lockstep) -> None:
    station.say(mavlink.MAVLink_param_request_list_message(VEHICLE, 1))
    first = station.until(is_a("PARAM_VALUE"), ANSWERED_S, "the hash")
    assert first.param_id == "_HASH_CHECK"
    station.say(mavlink.MAVLink_param_set_message(VEHICLE, 1, b"_HASH_CHECK", first.param_value, 5))
    station.run(0.1)
    assert not [m for m in station.run(1.0) if m.get_type() == "PARAM_VALUE"]


@pytest.mark.parametrize(
    "name",
    ["MPC_XY_VEL_MAX", "MIS_TAKEOFF_ALT", "RTL_RETURN_ALT", "SYS_AUTOSTART", "CAL_GYRO0_ID",
     "CAL_MAG0_ID", "CAL_ACC0_ID", "COM_RC_IN_MODE", "NAV_DLL_ACT", "BAT1_CAPACITY"],
)  # fmt: skip
def test_the_parameters_of_the_setup_pages_are_there(station: Lockstep, name: str) -> None:
    read = mavlink.MAVLink_param_request_read_message(VEHICLE, 1, name.encode(), -1)
    (value,) = ask(station, read, is_a("PARAM_VALUE", param_id=name))
    raw = struct.unpack("<i", struct.pack("<f", value.param_value))[0]
    assert not name.startswith("CAL_") or raw != 0, "a red badge"


@pytest.mark.parametrize("page", SETUP_PAGES)
def test_no_setup_page_misses_a_parameter(station: Lockstep, page: str) -> None:
    """Each name that a page reads and the vehicle lacks is in a dialog of missing parameters."""
    for name in SETUP_PAGES[page]:
        read = mavlink.MAVLink_param_request_read_message(VEHICLE, 1, name.encode(), -1)
        ask(station, read, is_a("PARAM_VALUE", param_id=name))


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_the_plans_are_reported(station: Lockstep, kind: int) -> None:
    request = mavlink.MAVLink_mission_request_list_message(VEHICLE, 1, kind)
    ask(station, request, is_a("MISSION_COUNT", mission_type=kind))


def test_a_repeated_system_time_changes_nothing(station: Lockstep) -> None:
    for _ in range(2):
        station.say(mavlink.MAVLink_system_time_message(1_700_000_000_000_000, 5))
    assert station.until(is_a("HEARTBEAT"), 1.1, "a heartbeat").system_status == 3


# Guided actions.


def upload(station: Lockstep, home: Any) -> None:
    """A plan as the plan view writes it: frame 3, degrees times 1e7, the first item current."""
    legs = [(NAV_TAKEOFF, 0, 10.0), (16, 2000, 12.0), (16, 2500, 12.0)]
    items = [
        mavlink.MAVLink_mission_item_int_message(
            VEHICLE, 1, seq, 3, number, int(seq == 0), 1, 0, 0, 0, NAN,
            home.latitude + north, home.longitude, height, 0,
        )
        for seq, (number, north, height) in enumerate(legs)
    ]  # fmt: skip
    station.say(mavlink.MAVLink_mission_count_message(VEHICLE, 1, len(items), 0))
    for item in items:
        station.until(is_a("MISSION_REQUEST_INT", seq=item.seq), ANSWERED_S, "a request")
        station.say(item)
    assert station.until(is_a("MISSION_ACK"), ANSWERED_S, "MISSION_ACK").type == 0


def take_off(station: Lockstep, amsl_m: float) -> None:
    assert command(station, long(NAV_TAKEOFF, -1, 0, 0, NAN, NAN, NAN, amsl_m)) == ACCEPTED
    shows(station, TAKEOFF, armed=False)
    assert command(station, long(ARM, 1)) == ACCEPTED
    shows(station, TAKEOFF, ARMED_S)


def landed(station: Lockstep) -> None:
    station.until(
        lambda m: m.get_type() == "HEARTBEAT" and not m.base_mode & ARMED, 90.0, "disarming"
    )
    station.until(is_a("EXTENDED_SYS_STATE", landed_state=1), ANSWERED_S, "the ground")


def test_the_guided_actions_show_in_time(station: Lockstep) -> None:
    home = station.newest["HOME_POSITION"]
    amsl_m = home.altitude / 1e3
    here = (home.latitude, home.longitude)
    upload(station, home)
    take_off(station, amsl_m + 8.0)
    station.until(is_a("HEARTBEAT", custom_mode=HOLD), 30.0, "the end of the take-off")

    north = home.latitude + 900
    assert command(station, place(REPOSITION, -1, 1, 0, NAN, north, here[1], amsl_m + 8)) == 0
    shows(station, HOLD)
    station.until(
        lambda m: m.get_type() == "GLOBAL_POSITION_INT" and abs(m.lat - north) < 150, 30.0, "there"
    )
    assert command(station, long(REPOSITION, -1, 1, 0, NAN, NAN, NAN, NAN)) == ACCEPTED
    assert command(station, long(REPOSITION, -1, 1, 0, NAN, NAN, NAN, amsl_m + 12)) == ACCEPTED
    station.until(lambda m: height_m(m) > 11.5, 20.0, "12 m")
    assert command(station, long(REPOSITION, -1, 1, 0, 1.0, NAN, NAN, NAN)) == ACCEPTED
    station.until(
        lambda m: m.get_type() == "ATTITUDE" and abs(m.yaw - 1.0) < 0.1, 20.0, "the heading"
    )
    assert command(station, long(SPEED, 1, 3.0, -1, 0)) == ACCEPTED

    assert command(station, place(DO_ORBIT, 15, NAN, 5, NAN, *here, amsl_m + 12)) == ACCEPTED
    shows(station, ORBIT)
    station.until(is_a("ORBIT_EXECUTION_STATUS"), 1.0, "the circle")
    assert command(station, long(REPOSITION, -1, 1, 0, NAN, NAN, NAN, NAN)) == ACCEPTED
    shows(station, HOLD)

    assert command(station, place(ROI, 0, 0, 0, 0, *here, amsl_m)) == ACCEPTED
    assert command(station, long(ROI_NONE)) == ACCEPTED
    degrees = (home.latitude / 1e7, home.longitude / 1e7)
    assert command(station, long(SET_HOME, 0, 0, 0, NAN, *degrees, amsl_m)) == ACCEPTED

    set_mode(station, FOLLOW)
    set_mode(station, HOLD)
    set_mode(station, MISSION)
    (ack, current) = ask(
        station,
        long(SET_CURRENT, 2, 0),
        is_a("COMMAND_ACK", command=SET_CURRENT, result=ACCEPTED),
        is_a("MISSION_CURRENT", seq=2),
    )
    assert ack is not current
    station.say(mavlink.MAVLink_mission_set_current_message(VEHICLE, 1, 1))
    station.until(is_a("MISSION_CURRENT", seq=1), ANSWERED_S, "the item that was chosen")
    set_mode(station, RETURN)
    set_mode(station, HOLD)
    set_mode(station, LAND)
    landed(station)


def test_a_mission_is_started_from_the_ground_and_stopped_in_an_emergency(
    station: Lockstep,
) -> None:
    upload(station, station.newest["HOME_POSITION"])
    set_mode(station, MISSION, armed=False)
    assert command(station, long(ARM, 1)) == ACCEPTED
    shows(station, MISSION, ARMED_S)
    station.until(lambda m: height_m(m) > 2.0, 20.0, "a vehicle in the air")
    assert command(station, long(ARM, 0, 0)) != ACCEPTED, "not in the air without force"
    assert command(station, long(ARM, 0, 21196)) == ACCEPTED
    shows(station, HOLD, ARMED_S, armed=False)


def test_a_mode_picked_on_the_ground_is_shown(tmp_path_factory: pytest.TempPathFactory) -> None:
    station = Lockstep(VEHICLE, tmp_path_factory.mktemp("on_the_ground"))
    station.until(is_a("HOME_POSITION"), 60.0, "home")
    for mode in (RETURN, LAND, POSITION, FOLLOW, HOLD, TAKEOFF, HOLD):
        set_mode(station, mode, armed=False)


def answer_to_plan(station: Lockstep, kind: int, items: list[Any]) -> int:
    """Upload a plan of a type; return the result of its MISSION_ACK."""
    station.say(mavlink.MAVLink_mission_count_message(VEHICLE, 1, len(items), kind))
    for item in items:
        station.until(is_a("MISSION_REQUEST_INT", seq=item.seq), ANSWERED_S, "a request")
        station.say(item)
    ack = station.until(is_a("MISSION_ACK", mission_type=kind), ANSWERED_S, "MISSION_ACK")
    return int(ack.type)


def test_a_plan_beyond_the_old_fence_is_taken_when_it_is_uploaded_again(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """PlanMasterController sends the mission, then the fence, whatever the first answer is."""
    station = Lockstep(VEHICLE, tmp_path_factory.mktemp("fences"))
    home = station.until(is_a("HOME_POSITION"), 60.0, "home")

    def item(seq: int, kind: int, command: int, p1: float, *at: float) -> Any:
        north, east, height = at
        return mavlink.MAVLink_mission_item_int_message(
            VEHICLE, 1, seq, 3 if kind == 0 else 0, command, int(seq == 0), 1, p1, 0, 0,
            NAN if kind == 0 else 0, home.latitude + round(north), home.longitude + round(east),
            height, kind,
        )  # fmt: skip

    def fence(reach: float) -> list[Any]:
        corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return [item(n, 1, 5001, 4, reach * a, reach * b, 0) for n, (a, b) in enumerate(corners)]

    def mission(north: float) -> list[Any]:
        return [item(0, 0, NAV_TAKEOFF, 0, 0, 0, 10), item(1, 0, 16, 0, north, 0, 12)]

    near, far = (mission(2000), fence(4000)), (mission(9000), fence(20_000))
    assert [answer_to_plan(station, kind, items) for kind, items in enumerate(near)] == [0, 0]
    assert [answer_to_plan(station, kind, items) for kind, items in enumerate(far)] == [5, 0]
    assert [answer_to_plan(station, kind, items) for kind, items in enumerate(far)] == [0, 0]
