"""Which messages of ground stations are forwarded, answered or refused."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.routing.policy import (
    ALLOWED_MESSAGES,
    MISSION_READS,
    Answer,
    BrokerControl,
    Decision,
    Drop,
    Forward,
    Refuse,
    decide,
)

MISSION = BrokerControl.MISSION
POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
OURS_US = 200_000.0
REQUIRED_US = {POSITION: OURS_US}


def decoded(message: Any) -> Any:
    (decoded,) = Decoder(keeps_unknown=True).decode(Encoder(255, 190).encode(message))
    return decoded


def decision_on(message: Any, control: BrokerControl = MISSION) -> Decision:
    return decide(decoded(message), control, REQUIRED_US)


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
READING = [
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


def test_messages_that_change_a_flight_are_refused_during_a_mission() -> None:
    forwarded = [str(m) for m in COMMANDING if not isinstance(decision_on(m), Refuse)]
    assert forwarded == []


def test_commands_are_forwarded_without_a_mission() -> None:
    refused = [str(m) for m in COMMANDING if decision_on(m, BrokerControl.FREE) != Forward()]
    assert refused == []


@pytest.mark.parametrize("control", [BrokerControl.FREE, MISSION])
def test_reading_messages_are_always_forwarded(control: BrokerControl) -> None:
    refused = [str(m) for m in READING if decision_on(m, control) != Forward()]
    assert refused == []


def test_only_listed_messages_are_forwarded_during_a_mission() -> None:
    listed = ALLOWED_MESSAGES | MISSION_READS | {"FILE_TRANSFER_PROTOCOL"}
    passing = {
        kind.msgname
        for kind in mavlink.mavlink_map.values()
        if decide(example(kind), MISSION, REQUIRED_US) == Forward()
    }
    assert passing <= listed
    assert listed - {"REQUEST_EVENT"} <= passing | {"REQUEST_EVENT"}


def test_unknown_messages_are_refused_during_a_mission() -> None:
    body = bytes((1, 0, 0, 0, 255, 190)) + (70_000).to_bytes(3, "little") + b"x" + b"\0\0"
    (unknown,) = Decoder(keeps_unknown=True).decode(b"\xfd" + body)
    assert isinstance(decide(unknown, MISSION, REQUIRED_US), Refuse)
    assert decide(unknown, BrokerControl.FREE, REQUIRED_US) == Forward()


@pytest.mark.parametrize("control", list(BrokerControl))
def test_keys_never_pass(control: BrokerControl) -> None:
    message = mavlink.MAVLink_setup_signing_message(1, 1, [7] * 32, 1)
    assert decision_on(message, control) == Refuse()


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
        decision = decision_on(mavlink.MAVLink_param_set_message(1, 1, b"NAV_ACC_RAD", 1.0, 9))
        assert isinstance(decision, Refuse)
        assert decision.answer is None
        assert decision.instead is not None
        assert decision.instead.get_type() == "PARAM_REQUEST_READ"
        assert decoded(decision.instead).param_id == "NAV_ACC_RAD"

    def test_a_file_is_protected(self) -> None:
        payload = self.answer(files(11)).payload
        number = payload[0] | payload[1] << 8
        assert (number, payload[2], payload[3], payload[4]) == (10, 3, 129, 1)
        assert (payload[5], payload[12]) == (11, 9)

    @staticmethod
    def answer(message: Any) -> Any:
        decision = decision_on(message)
        assert isinstance(decision, Refuse)
        return decoded(decision.answer)


class TestMessageRates:
    def request(self, number: float, interval_us: float, component: int = 1) -> Decision:
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return decision_on(command(interval, number, interval_us, component=component))

    @pytest.mark.parametrize("interval_us", [-1.0, 0.0, OURS_US * 1.01, 1e9, math.nan])
    def test_a_lower_rate_of_a_required_message_is_accepted_and_not_forwarded(
        self, interval_us: float
    ) -> None:
        decision = self.request(POSITION, interval_us)
        assert isinstance(decision, Answer)
        assert decoded(decision.message).result == mavlink.MAV_RESULT_ACCEPTED

    @pytest.mark.parametrize("interval_us", [OURS_US, OURS_US / 4])
    def test_a_higher_rate_of_a_required_message_is_forwarded(self, interval_us: float) -> None:
        assert self.request(POSITION, interval_us) == Forward()

    @pytest.mark.parametrize("interval_us", [-1.0, 0.0, 1e4, 1e7])
    def test_every_rate_of_other_messages_is_forwarded(self, interval_us: float) -> None:
        assert self.request(mavlink.MAVLINK_MSG_ID_VFR_HUD, interval_us) == Forward()
        assert self.request(POSITION, interval_us, component=100) == Forward()

    @given(st.floats(width=32), st.floats(width=32))
    def test_any_numbers_get_an_answer(self, number: float, interval_us: float) -> None:
        assert isinstance(self.request(number, interval_us), Forward | Answer)

    @pytest.mark.parametrize(("rate_hz", "start"), [(0, 1), (1, 1), (4, 0)])
    def test_groups_of_messages_are_not_slowed_down_or_stopped(
        self, rate_hz: int, start: int
    ) -> None:
        message = mavlink.MAVLink_request_data_stream_message(1, 1, 0, rate_hz, start)
        assert decision_on(message, BrokerControl.FREE) == Drop()


def test_reading_missions_waits_for_the_brokers_own_transfer() -> None:
    request = mavlink.MAVLink_mission_request_list_message(1, 1)
    assert decision_on(request, BrokerControl.TRANSFER) == Drop()
    assert isinstance(
        decision_on(mavlink.MAVLink_mission_count_message(1, 1, 3), BrokerControl.TRANSFER), Refuse
    )
