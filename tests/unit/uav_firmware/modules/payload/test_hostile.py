"""The payload survives any order, stays within its range, and answers once."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.payload.harness import MISSION, OPERATOR, RIVAL, PayloadHarness
from uav_firmware.msg.payload import GimbalOrder, PayloadCommand
from uav_firmware.msg.status import CommandResult, NavigationState

NUMBER = st.one_of(
    st.floats(width=32),
    st.sampled_from(
        [math.nan, math.inf, -math.inf, 0.0, 1.0, -1.0, -2.0, 0.5, 2.0, 45.0, -90.0, 360.0]
    ),
)
ORDERS = st.lists(
    st.tuples(
        st.sampled_from([*PayloadCommand, 9999]),
        st.lists(NUMBER, min_size=7, max_size=7),
        st.sampled_from([OPERATOR, RIVAL, MISSION]),
    ),
    max_size=12,
)
FINAL = {int(result) for result in CommandResult} - {CommandResult.IN_PROGRESS}


@given(ORDERS, st.lists(st.sampled_from(NavigationState), max_size=3))
@settings(max_examples=150, deadline=None)
def test_any_order_is_survived_and_answered_once(
    orders: list[tuple[int, list[float], tuple[int, int]]], states: list[NavigationState]
) -> None:
    harness = PayloadHarness()
    harness.command(PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE, -2, -2, -1, -1)
    tokens = []
    for number, parameters, sender in orders:
        who = next(each for each in (OPERATOR, RIVAL, MISSION) if each == sender)
        token = harness.order(int(number), *parameters, sender=who)
        tokens += [token] if token else []
        harness.run(0.12)
    for state in states:
        harness.flies(state)
        harness.run(0.2)
    harness.flies(NavigationState.AUTO_RTL)  # ends what is in progress
    harness.run(0.2)
    finals = [ack.token for ack in harness.acks.drain() if ack.result in FINAL]
    assert sorted(finals) == sorted(tokens)
    assert -90.0 - 1e-6 <= harness.pitch_deg <= 30.0 + 1e-6
    assert math.isfinite(harness.yaw_deg)
    assert harness.camera_status.used_mib <= harness.camera_status.total_mib


@given(st.integers(0, 0xFFFF), st.tuples(NUMBER, NUMBER, NUMBER, NUMBER), st.booleans())
@settings(max_examples=100, deadline=None)
def test_any_streamed_order_is_survived(
    flags: int, values: tuple[float, float, float, float], normalised: bool
) -> None:
    harness = PayloadHarness()
    harness.command(PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE, -2, -2, -1, -1)
    pitch, yaw, pitch_rate, yaw_rate = values
    harness.orders.publish(
        GimbalOrder(0, OPERATOR, flags, pitch, yaw, pitch_rate, yaw_rate, normalised)
    )
    harness.run(1.0)
    assert -90.0 - 1e-6 <= harness.pitch_deg <= 30.0 + 1e-6
    assert math.isfinite(harness.yaw_deg)
