"""A stream of offboard setpoints that breaks, and one that is too slow to fly by."""

from tests.support.toy_vehicle import ToyVehicle
from tests.unit.uav_firmware.modules.commander.failsafe.test_machine import (
    HOLD,
    RETURN,
    State,
    centre,
    on_mission,
    stream,
)
from uav_firmware.msg.status import Command

LOST, OVER = "Offboard setpoints lost: HOLD", "Offboard setpoints lost: over"


def choose_offboard(vehicle: ToyVehicle) -> None:
    assert vehicle.send(Command.DO_SET_MODE, 1.0, 6.0, 0.0) == 0


def stream_slowly(vehicle: ToyVehicle, seconds: int) -> None:
    """A setpoint every two seconds."""
    for _ in range(seconds // 2):
        stream(vehicle, 0.05)
        vehicle.run(1.95)


def lost_offboard(**settings: float) -> ToyVehicle:
    vehicle = on_mission(**settings)
    stream(vehicle, 0.2)
    choose_offboard(vehicle)
    stream(vehicle, 1.0)
    vehicle.run(1.3)
    assert vehicle.mode is HOLD
    return vehicle


def test_a_slow_stream_is_reported_once() -> None:
    vehicle = lost_offboard()
    stream_slowly(vehicle, 20)
    assert vehicle.mode is HOLD
    assert (vehicle.texts.count(LOST), vehicle.texts.count(OVER)) == (1, 0)


def test_a_stream_without_a_break_ends_the_loss_and_the_next_one_is_new() -> None:
    vehicle = lost_offboard()
    stream(vehicle, 2.5)
    assert (vehicle.texts.count(LOST), vehicle.texts.count(OVER)) == (1, 1)
    vehicle.run(1.3)
    assert vehicle.texts.count(LOST) == 2


def test_a_slow_stream_that_is_chosen_again_is_lost_again() -> None:
    vehicle = lost_offboard()
    for losses in (2, 3):
        stream_slowly(vehicle, 4)
        stream(vehicle, 0.05)
        choose_offboard(vehicle)
        vehicle.run(0.3)
        assert vehicle.mode is State.OFFBOARD
        assert vehicle.texts.count(OVER) == losses - 1
        vehicle.run(1.0)
        assert vehicle.mode is HOLD
        assert vehicle.texts.count(LOST) == losses


def test_a_slow_stream_does_not_put_off_the_return() -> None:
    vehicle = lost_offboard(COM_OBL_RC_ACT=3, COM_FAIL_ACT_T=5.0)
    stream_slowly(vehicle, 6)
    assert vehicle.mode is RETURN


def test_sticks_lost_after_the_change_to_the_pilot_s_mode_take_their_own_action() -> None:
    vehicle = on_mission(COM_FAIL_ACT_T=5.0)
    stream(vehicle, 0.2)
    choose_offboard(vehicle)
    stream(vehicle, 1.0)
    centre(vehicle, 1.5)
    assert vehicle.mode is State.POSCTL
    vehicle.run(1.0)
    assert vehicle.mode is HOLD
    assert "Manual control lost: RETURN" in vehicle.texts
    vehicle.run(5.0)
    assert vehicle.mode is RETURN
