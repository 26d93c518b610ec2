"""Whatever is ordered: the payload goes on, stays within its range, and answers once."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.payload.bench import MISSION, OPERATOR, RIVAL, Bench
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
def test_no_order_breaks_it_and_each_is_answered_once(
    orders: list[tuple[int, list[float], tuple[int, int]]], states: list[NavigationState]
) -> None:
    bench = Bench()
    bench.ask(PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE, -2, -2, -1, -1)
    tokens = []
    for number, parameters, sender in orders:
        who = next(each for each in (OPERATOR, RIVAL, MISSION) if each == sender)
        token = bench.order(int(number), *parameters, sender=who)
        tokens += [token] if token else []
        bench.run(0.12)
    for state in states:
        bench.flies(state)
        bench.run(0.2)
    bench.flies(NavigationState.AUTO_RTL)  # ends what is in progress
    bench.run(0.2)
    finals = [ack.token for ack in bench.acks.drain() if ack.result in FINAL]
    assert sorted(finals) == sorted(tokens)
    assert -90.0 - 1e-6 <= bench.pitch_deg <= 30.0 + 1e-6
    assert math.isfinite(bench.yaw_deg)
    assert bench.seen.used_mib <= bench.seen.total_mib


@given(st.integers(0, 0xFFFF), st.tuples(NUMBER, NUMBER, NUMBER, NUMBER), st.booleans())
@settings(max_examples=100, deadline=None)
def test_no_stream_breaks_it(
    flags: int, wish: tuple[float, float, float, float], normalised: bool
) -> None:
    bench = Bench()
    bench.ask(PayloadCommand.DO_GIMBAL_MANAGER_CONFIGURE, -2, -2, -1, -1)
    pitch, yaw, pitch_rate, yaw_rate = wish
    bench.orders.publish(
        GimbalOrder(0, OPERATOR, flags, pitch, yaw, pitch_rate, yaw_rate, normalised)
    )
    bench.run(1.0)
    assert -90.0 - 1e-6 <= bench.pitch_deg <= 30.0 + 1e-6
    assert math.isfinite(bench.yaw_deg)
