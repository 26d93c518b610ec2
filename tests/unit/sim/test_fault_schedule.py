"""The schedule of faults: when what acts, and what is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.fault_schedule import (
    ALL_INSTANCES,
    FIELDS,
    NEVER_US,
    Fault,
    FaultError,
    FaultSchedule,
    Kind,
)

TIMES = st.integers(0, 100_000_000)
PLAIN = [
    kind for kind, fields in FIELDS.items() if all(f.default is not None for f in fields.values())
]


@st.composite
def faults(draw: st.DrawFn) -> Fault:
    start = draw(TIMES)
    end = draw(st.one_of(st.just(NEVER_US), st.integers(start + 1, start + 100_000_000)))
    return Fault(kind=draw(st.sampled_from(PLAIN)), start_us=start, end_us=end)


@given(several=st.lists(faults(), max_size=6), now=TIMES)
def test_between_two_changes_the_active_faults_stay_the_same(
    several: list[Fault], now: int
) -> None:
    schedule = FaultSchedule(several)
    change = schedule.next_change_us(now)
    assert change > now
    last = min(change - 1, now + 10**9)
    assert schedule.active(last) == schedule.active(now)
    if change != NEVER_US:
        assert schedule.active(change) != schedule.active(now)


@given(several=st.lists(faults(), max_size=6), now=TIMES)
def test_clearing_ends_everything_for_good(several: list[Fault], now: int) -> None:
    schedule = FaultSchedule(several)
    past = [fault for fault in several if fault.start_us < now]
    schedule.clear(now)
    assert schedule.active(now) == ()
    assert schedule.next_change_us(now) == NEVER_US
    assert [fault.kind for fault in schedule.faults] == [fault.kind for fault in past]


@given(one=faults(), other=faults(), now=TIMES)
def test_clearing_a_kind_leaves_the_others(one: Fault, other: Fault, now: int) -> None:
    schedule = FaultSchedule([one, other])
    before = [fault for fault in schedule.active(now) if fault.kind is not one.kind]
    schedule.clear(now, one.kind)
    assert list(schedule.active(now)) == before


def test_clearing_a_motor_leaves_the_other_motors() -> None:
    one, two = (Fault(kind=Kind.MOTOR_LOSS, values={"motor": motor}) for motor in (1, 2))
    schedule = FaultSchedule([one, two])
    schedule.clear(5, Kind.MOTOR_LOSS, motor=1)
    assert [fault.values["motor"] for fault in schedule.active(5)] == [2]


@pytest.mark.parametrize(
    ("kind", "values", "words"),
    [
        (Kind.MOTOR_LOSS, {}, "motor is missing"),
        (Kind.MOTOR_LOSS, {"motor": 5}, "motor 5 is outside 1..4"),
        (Kind.MOTOR_LOSS, {"motor": 1.5}, "motor 1.5 is no whole number"),
        (Kind.MOTOR_LOSS, {"motor": 1, "thrust": 2}, "there is no 'thrust'"),
        (Kind.MOTOR_LOSS, {"motor": True}, "finite number"),
        (Kind.GPS_JUMP, {"north_m": math.nan}, "north_m must be a finite number"),
        (Kind.BATTERY_LOW, {"charge": -0.1}, "charge -0.1 is outside 0..1"),
        (Kind.GPS_LOSS, {"motor": 1}, "it takes no numbers"),
    ],
)
def test_what_cannot_be_is_refused_by_name(
    kind: Kind, values: dict[str, float], words: str
) -> None:
    with pytest.raises(FaultError, match=words):
        Fault(kind=kind, values=values)


@pytest.mark.parametrize(("start", "end"), [(-1, NEVER_US), (5, 5), (5, 4)])
def test_times_that_do_not_follow_each_other_are_refused(start: int, end: int) -> None:
    with pytest.raises(FaultError):
        Fault(kind=Kind.GPS_LOSS, start_us=start, end_us=end)


@pytest.mark.parametrize(("instance", "left"), [(1, {0, 2}), (ALL_INSTANCES, set()), (None, set())])
def test_one_instance_of_a_fault_of_all_can_be_cleared(
    instance: int | None, left: set[int]
) -> None:
    values = {"x_deg_s": 3.0, "instance": ALL_INSTANCES}
    schedule = FaultSchedule([Fault(kind=Kind.GYRO_BIAS, start_us=2, values=values)])
    schedule.clear(5, Kind.GYRO_BIAS, instance=instance)
    assert {fault.values["instance"] for fault in schedule.active(5)} == left
    assert all(fault.values["x_deg_s"] == 3.0 for fault in schedule.active(5))
    assert schedule.active(4)


def test_clearing_all_instances_clears_each_that_is_named() -> None:
    schedule = FaultSchedule([Fault(kind=Kind.GYRO_LOSS, values={"instance": 1})])
    schedule.clear(5, Kind.GYRO_LOSS, instance=ALL_INSTANCES)
    assert schedule.active(5) == ()
