"""Mission messages with anything in every field, before the vehicle's judges."""

import math
import struct
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.contract.test_mission_answers import Uploader, item
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink

REPETITIONS = 3  # A tick may ask again for an item of each type of plan
FLOATS = st.floats(width=32)
SMALL = st.one_of(st.integers(0, 3), st.integers(0, 255))
COMMANDS = st.one_of(
    st.sampled_from([16, 17, 18, 19, 20, 21, 22, 31, 82, 93, 112, 114, 115, 177, 178, 179, 195]),
    st.sampled_from([197, 201, 5000, 5001, 5002, 5003, 5004, 5100]),
    st.integers(0, 0xFFFF),
)
NUMBERS = {
    "uint8_t": SMALL,
    "uint16_t": st.one_of(st.integers(0, 4), st.integers(0, 0xFFFF)),
    "int16_t": st.integers(-0x8000, 0x7FFF),
    "int32_t": st.one_of(
        st.sampled_from([0, 404_434_000, -37_382_000, 0x7FFFFFFF, -0x80000000]),
        st.integers(-0x80000000, 0x7FFFFFFF),
    ),
    "uint32_t": st.integers(0, 0xFFFFFFFF),
    "float": st.one_of(st.sampled_from([0.0, math.nan, 1.0, 3.0, -1.0]), FLOATS),
}
MESSAGES = [
    mavlink.MAVLink_mission_count_message,
    mavlink.MAVLink_mission_item_int_message,
    mavlink.MAVLink_mission_item_int_message,
    mavlink.MAVLink_mission_item_int_message,
    mavlink.MAVLink_mission_item_message,
    mavlink.MAVLink_mission_request_int_message,
    mavlink.MAVLink_mission_request_message,
    mavlink.MAVLink_mission_request_list_message,
    mavlink.MAVLink_mission_clear_all_message,
    mavlink.MAVLink_mission_ack_message,
    mavlink.MAVLink_mission_request_partial_list_message,
    mavlink.MAVLink_mission_write_partial_list_message,
]


@st.composite
def mission_messages(draw: st.DrawFn) -> Message:
    """One message of the protocol, addressed to the vehicle."""
    kind: Any = draw(st.sampled_from(MESSAGES))
    fields = {
        name: draw(NUMBERS[form])
        for name, form in zip(kind.fieldnames, kind.fieldtypes, strict=True)
    }
    fields |= {"target_system": 1, "target_component": 1}
    if "command" in fields:
        fields["command"] = draw(COMMANDS)
    if "mission_type" in fields:
        fields["mission_type"] = draw(st.sampled_from([0, 0, 0, 1, 2, 3, 255]))
    return kind(**fields)


@settings(max_examples=100, deadline=None)
@given(st.lists(mission_messages(), max_size=12))
def test_each_message_is_answered_in_bounds_and_the_next_plan_is_accepted(
    messages: list[Message],
) -> None:
    uploader = Uploader()
    for message in messages:
        answers = [m for m in uploader.send(message) if m.get_type() != "STATUSTEXT"]
        assert len(answers) <= 1 + REPETITIONS
    assert uploader.upload([item(16), item(16)]) == (0, 2)


@settings(deadline=None)
@given(st.binary(min_size=30, max_size=30), COMMANDS)
def test_any_bits_of_an_item_are_accepted_or_refused_with_a_result(
    body: bytes, command: int
) -> None:
    *p, x, y, frame, current = struct.unpack("<4fiiBB", body[:26])
    result, _ = Uploader().upload(
        [item(command, *p, frame=frame % 8, x=x, y=y, z=z_of(body), current=current)]
    )
    assert 0 <= result <= 15


def z_of(body: bytes) -> float:
    (z,) = struct.unpack("<f", body[26:])
    return float(z)
