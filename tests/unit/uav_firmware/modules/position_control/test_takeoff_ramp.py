import itertools

import pytest

from uav_firmware.modules.position_control.takeoff_ramp import (
    TRANSITIONS,
    Takeoff,
    TakeoffEvent,
    TakeoffRamp,
)


def advance(
    ramp: TakeoffRamp,
    now_s: float,
    *,
    armed: bool = True,
    landed: bool = True,
    wants_climb: bool = False,
) -> Takeoff:
    return ramp.update(
        now_s=now_s,
        armed=armed,
        landed=landed,
        wants_climb=wants_climb,
        spool_up_time_s=1.0,
        ramp_time_s=2.0,
    )


def flying() -> TakeoffRamp:
    ramp = TakeoffRamp()
    advance(ramp, 0.0)
    advance(ramp, 1.0)
    advance(ramp, 1.1, wants_climb=True)
    advance(ramp, 2.0, landed=False, wants_climb=True)
    advance(ramp, 3.1, landed=False)
    assert ramp.state is Takeoff.FLIGHT
    return ramp


def limit(ramp: TakeoffRamp, now_s: float) -> float:
    return ramp.thrust_limit(now_s=now_s, ramp_time_s=2.0, start=0.1, full=0.9)


def test_motors_idle_until_spooled_up_however_much_climb_is_wanted() -> None:
    ramp = TakeoffRamp()
    advance(ramp, 0.0, wants_climb=True)
    assert advance(ramp, 0.9, wants_climb=True) is Takeoff.SPOOL_UP
    assert limit(ramp, 0.9) == 0.0


def test_an_armed_vehicle_waits_on_the_ground_for_an_order_to_climb() -> None:
    ramp = TakeoffRamp()
    advance(ramp, 0.0)
    advance(ramp, 1.0)
    assert advance(ramp, 60.0) is Takeoff.READY
    assert limit(ramp, 60.0) == 0.0


def test_the_thrust_limit_rises_from_idle_to_full() -> None:
    ramp = TakeoffRamp()
    advance(ramp, 0.0)
    advance(ramp, 1.0)
    advance(ramp, 5.0, wants_climb=True)
    limits = [limit(ramp, 5.0 + 0.1 * step) for step in range(21)]
    assert limits[0] == pytest.approx(0.1)
    assert limits[-1] == pytest.approx(0.9)
    assert all(later > former for former, later in itertools.pairwise(limits))


def test_landing_takes_the_thrust_away() -> None:
    ramp = flying()
    assert limit(ramp, 10.0) == 0.9
    assert advance(ramp, 10.0, landed=True) is Takeoff.READY
    assert limit(ramp, 10.0) == 0.0


def test_a_slow_lift_off_is_no_landing() -> None:
    ramp = TakeoffRamp()
    advance(ramp, 0.0)
    advance(ramp, 1.0)
    advance(ramp, 1.1, wants_climb=True)
    advance(ramp, 3.2)
    assert advance(ramp, 3.3) is Takeoff.FLIGHT


def test_a_landing_seen_by_mistake_gives_the_thrust_back() -> None:
    ramp = flying()
    advance(ramp, 10.0, landed=True)
    assert advance(ramp, 10.2, landed=False) is Takeoff.FLIGHT


def test_arming_in_the_air_flies_at_once() -> None:
    ramp = TakeoffRamp()
    advance(ramp, 0.0, landed=False)
    assert advance(ramp, 0.01, landed=False) is Takeoff.FLIGHT


@pytest.mark.parametrize("state", list(Takeoff))
def test_disarming_ends_every_state(state: Takeoff) -> None:
    ramp = TakeoffRamp()
    ramp.state = state
    assert advance(ramp, 1.0, armed=False) is Takeoff.DISARMED


def test_only_a_climb_leads_off_the_ground() -> None:
    upwards = {
        event
        for (state, event), target in TRANSITIONS.items()
        if state is Takeoff.READY and target is not Takeoff.DISARMED
    }
    assert upwards == {TakeoffEvent.CLIMB, TakeoffEvent.LIFTED}
