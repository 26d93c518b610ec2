"""What a ground station may say, to whom it makes a difference, and what it is told instead."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.forwarding import allowed
from mavlink_broker.forwarding.policy import judge
from mavlink_broker.forwarding.verdict import Answer, Later, Pass, Refuse, Tenure, Verdict
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import mavlink

MISSION = Tenure.MISSION
POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
OURS_US = 200_000.0
LIVED_ON = {POSITION: OURS_US}


def heard(message: Any) -> Any:
    (decoded,) = Decoder(keeps_unknown=True).decode(Encoder(255, 190).encode(message))
    return decoded


def verdict(message: Any, tenure: Tenure = MISSION) -> Verdict:
    return judge(heard(message), tenure, LIVED_ON)


def command(number: int, *parameters: float, component: int = 1) -> Any:
    p = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(1, component, number, 0, *p)


def files(opcode: int) -> Any:
    return mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, [9, 0, 3, opcode] + [0] * 247)


def example(kind: type) -> Any:
    """A message of a class, with nothing but zeros in it."""
    message_class: Any = kind
    size = message_class.unpacker.size
    payload = bytes(size)
    codec = mavlink.MAVLink(None, 255, 190)
    header = bytes((0xFD, size, 0, 0, 0, 255, 190)) + message_class.id.to_bytes(3, "little")
    checksum = mavlink.x25crc(header[1:] + payload + bytes((message_class.crc_extra,))).crc
    return codec.decode(bytearray(header + payload + checksum.to_bytes(2, "little")))


COMMANDING = [
    command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, 21196.0),
    command(mavlink.MAV_CMD_NAV_LAND),
    command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 3),
    command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1),
    command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1),
    command(65_000),
    mavlink.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, 0, 1, 1, 5),
    mavlink.MAVLink_set_mode_message(1, 1, 0),
    mavlink.MAVLink_mission_count_message(1, 1, 3),
    mavlink.MAVLink_mission_clear_all_message(1, 1),
    mavlink.MAVLink_mission_set_current_message(1, 1, 0),
    mavlink.MAVLink_param_set_message(1, 1, b"MPC_XY_VEL_MAX", 1.0, 9),
    mavlink.MAVLink_param_ext_set_message(1, 100, b"CAM_MODE", b"1", 1),
    mavlink.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0),
    mavlink.MAVLink_rc_channels_override_message(1, 1, *[1500] * 8),
    mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0, *[0] * 11),
    mavlink.MAVLink_set_attitude_target_message(0, 1, 1, 0, [1, 0, 0, 0], 0, 0, 0, 0),
    mavlink.MAVLink_set_gps_global_origin_message(1, 0, 0, 0),
    mavlink.MAVLink_log_erase_message(1, 1),
    mavlink.MAVLink_serial_control_message(0, 0, 0, 0, 5, [0] * 70),
    mavlink.MAVLink_system_time_message(0, 0),
    *(files(opcode) for opcode in (6, 7, 8, 9, 10, 11, 12, 13, 200)),
]
WATCHING = [
    command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148),
    command(mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1),
    command(mavlink.MAV_CMD_GET_HOME_POSITION),
    command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_VFR_HUD, 5e5),
    mavlink.MAVLink_param_request_list_message(1, 1),
    mavlink.MAVLink_param_request_read_message(1, 1, b"X", -1),
    mavlink.MAVLink_param_set_message(1, 1, b"_HASH_CHECK", 0.0, 5),
    mavlink.MAVLink_mission_request_list_message(1, 1),
    mavlink.MAVLink_mission_request_int_message(1, 1, 0),
    mavlink.MAVLink_mission_ack_message(1, 1, 0),
    mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF),
    mavlink.MAVLink_ping_message(0, 0, 1, 1),
    mavlink.MAVLink_timesync_message(0, 1),
    mavlink.MAVLink_request_data_stream_message(1, 1, 0, 4, 1),
    *(files(opcode) for opcode in (0, 1, 2, 3, 4, 5, 14, 15, 16)),
]


@pytest.mark.parametrize("message", COMMANDING, ids=str)
def test_what_changes_a_flight_is_refused_while_a_mission_runs(message: Any) -> None:
    assert isinstance(verdict(message), Refuse)


@pytest.mark.parametrize("message", COMMANDING, ids=str)
def test_and_goes_over_when_none_does(message: Any) -> None:
    assert verdict(message, Tenure.FREE) == Pass()


@pytest.mark.parametrize("tenure", [Tenure.FREE, MISSION])
@pytest.mark.parametrize("message", WATCHING, ids=str)
def test_who_only_watches_is_never_hindered(message: Any, tenure: Tenure) -> None:
    assert verdict(message, tenure) == Pass()


def test_nothing_passes_that_is_on_no_list() -> None:
    listed = allowed.MESSAGES | allowed.MISSION_READS | {"FILE_TRANSFER_PROTOCOL"}
    passing = {
        kind.msgname
        for kind in mavlink.mavlink_map.values()
        if judge(example(kind), MISSION, LIVED_ON) == Pass()
    }
    assert passing <= listed
    assert listed - {"REQUEST_EVENT"} <= passing | {"REQUEST_EVENT"}


def test_nothing_passes_that_nobody_knows() -> None:
    body = bytes((1, 0, 0, 0, 255, 190)) + (70_000).to_bytes(3, "little") + b"x" + b"\0\0"
    (unknown,) = Decoder(keeps_unknown=True).decode(b"\xfd" + body)
    assert isinstance(judge(unknown, MISSION, LIVED_ON), Refuse)
    assert judge(unknown, Tenure.FREE, LIVED_ON) == Pass()


@pytest.mark.parametrize("tenure", list(Tenure))
def test_keys_never_pass(tenure: Tenure) -> None:
    message = mavlink.MAVLink_setup_signing_message(1, 1, [7] * 32, 1)
    assert verdict(message, tenure) == Refuse()


class TestAnswers:
    def test_a_command_is_temporarily_rejected(self) -> None:
        answer = self.answer(command(mavlink.MAV_CMD_NAV_LAND))
        assert answer.get_type() == "COMMAND_ACK"
        assert answer.command == mavlink.MAV_CMD_NAV_LAND
        assert answer.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        assert (answer.target_system, answer.target_component) == (255, 190)

    @pytest.mark.parametrize("mission_type", [0, 1, 2])
    def test_an_upload_is_denied_for_its_own_kind_of_list(self, mission_type: int) -> None:
        answer = self.answer(mavlink.MAVLink_mission_count_message(1, 1, 3, mission_type))
        assert answer.get_type() == "MISSION_ACK"
        assert answer.type == mavlink.MAV_MISSION_DENIED
        assert answer.mission_type == mission_type

    def test_a_parameter_is_read_instead_of_set(self) -> None:
        refusal = verdict(mavlink.MAVLink_param_set_message(1, 1, b"NAV_ACC_RAD", 1.0, 9))
        assert isinstance(refusal, Refuse)
        assert refusal.answer is None
        assert refusal.instead is not None
        assert refusal.instead.get_type() == "PARAM_REQUEST_READ"
        assert heard(refusal.instead).param_id == "NAV_ACC_RAD"

    def test_a_file_is_protected(self) -> None:
        payload = self.answer(files(11)).payload
        number = payload[0] | payload[1] << 8
        assert (number, payload[2], payload[3], payload[4]) == (10, 3, 129, 1)
        assert (payload[5], payload[12]) == (11, 9)

    @staticmethod
    def answer(message: Any) -> Any:
        refusal = verdict(message)
        assert isinstance(refusal, Refuse)
        return heard(refusal.answer)


class TestHowOftenAMessageComes:
    def ask(self, number: float, interval_us: float, component: int = 1) -> Verdict:
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return verdict(command(interval, number, interval_us, component=component))

    @pytest.mark.parametrize("interval_us", [-1.0, 0.0, OURS_US * 1.01, 1e9, math.nan])
    def test_what_the_broker_lives_on_gets_no_slower_but_that_is_no_fault(
        self, interval_us: float
    ) -> None:
        answered = self.ask(POSITION, interval_us)
        assert isinstance(answered, Answer)
        assert heard(answered.message).result == mavlink.MAV_RESULT_ACCEPTED

    @pytest.mark.parametrize("interval_us", [OURS_US, OURS_US / 4])
    def test_but_may_be_had_faster(self, interval_us: float) -> None:
        assert self.ask(POSITION, interval_us) == Pass()

    @pytest.mark.parametrize("interval_us", [-1.0, 0.0, 1e4, 1e7])
    def test_everything_else_is_as_the_ground_station_likes(self, interval_us: float) -> None:
        assert self.ask(mavlink.MAVLINK_MSG_ID_VFR_HUD, interval_us) == Pass()
        assert self.ask(POSITION, interval_us, component=100) == Pass()

    @given(st.floats(width=32), st.floats(width=32))
    def test_any_numbers_get_an_answer(self, number: float, interval_us: float) -> None:
        assert isinstance(self.ask(number, interval_us), Pass | Answer)

    @pytest.mark.parametrize(("rate_hz", "start"), [(0, 1), (1, 1), (4, 0)])
    def test_groups_of_messages_are_not_slowed_down_or_stopped(
        self, rate_hz: int, start: int
    ) -> None:
        message = mavlink.MAVLink_request_data_stream_message(1, 1, 0, rate_hz, start)
        assert verdict(message, Tenure.FREE) == Later()


def test_reading_missions_waits_for_the_brokers_own_transfer() -> None:
    request = mavlink.MAVLink_mission_request_list_message(1, 1)
    assert verdict(request, Tenure.TRANSFER) == Later()
    assert isinstance(
        verdict(mavlink.MAVLink_mission_count_message(1, 1, 3), Tenure.TRANSFER), Refuse
    )
