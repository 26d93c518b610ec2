"""What a scripted vehicle refuses: the MAV_RESULT of a command, before it is obeyed."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from tests.support.px4_gimbal import Sender
from tests.support.vehicle_script import COPTER_AUTO, COPTER_GUIDED
from tests.support.vehicle_wire import Message, mavlink

if TYPE_CHECKING:
    from tests.support.scripted_vehicle import ScriptedVehicle

FORCED = 21196.0
"""Second parameter of MAV_CMD_COMPONENT_ARM_DISARM that disarms in the air."""
CAMERA_COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
        mavlink.MAV_CMD_CAMERA_TRACK_POINT,
        mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE,
        mavlink.MAV_CMD_CAMERA_STOP_TRACKING,
    }
)
GIMBAL_COMMANDS = frozenset(
    {mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE}
)


def is_for_payload(vehicle: "ScriptedVehicle", message: Message) -> bool:
    """Answer for a camera and a gimbal that are not there, as PX4 does.

    A command to another component has FAILED or is ignored; a gimbal's commands are left to a
    manager that does not run, so there is no answer.
    """
    if message.target_component not in {0, 1}:
        if not vehicle.script.refuses_for_others:
            return True
        failed = mavlink.MAV_RESULT_FAILED
        vehicle.send(mavlink.MAVLink_command_ack_message(message.command, failed))
        return True
    if message.command in CAMERA_COMMANDS:
        unknown = mavlink.MAV_RESULT_UNSUPPORTED
        vehicle.send(mavlink.MAVLink_command_ack_message(message.command, unknown))
    return message.command in CAMERA_COMMANDS | GIMBAL_COMMANDS


def judge(vehicle: "ScriptedVehicle", message: Message) -> int:
    """MAV_RESULT of a command, before it is obeyed."""
    script = vehicle.script
    if script.manages_gimbal and message.command in GIMBAL_COMMANDS:
        sender = Sender(message.get_srcSystem(), message.get_srcComponent())
        return vehicle.gimbal.order(message.command, vehicle.parameters[-1][1], sender)
    refusals: dict[int, Callable[[], int]] = {
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM: lambda: _judge_arming(vehicle, message),
        mavlink.MAV_CMD_MISSION_START: lambda: _judge_start(vehicle),
        mavlink.MAV_CMD_DO_SET_MODE: lambda: _judge_mode(
            vehicle, int(message.param2), int(message.param3)
        ),
        mavlink.MAV_CMD_DO_PAUSE_CONTINUE: lambda: _judge_pause(vehicle),
    }
    result: int = script.results.get(message.command, mavlink.MAV_RESULT_ACCEPTED)
    if result == mavlink.MAV_RESULT_ACCEPTED and message.command in refusals:
        return refusals[message.command]()
    unknown = {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: not script.knows_intervals,
        mavlink.MAV_CMD_REQUEST_MESSAGE: (
            message.param1 == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT
            and not script.sends_current_on_request
        ),
    }
    is_unknown = unknown.get(message.command, False)
    return int(mavlink.MAV_RESULT_UNSUPPORTED) if is_unknown else result


def may_arm_here(vehicle: "ScriptedVehicle") -> bool:
    """Whether it arms in its present mode."""
    arms_in = vehicle.script.arms_in
    if vehicle.script.readiness_by_mode and vehicle.in_mission and not vehicle.items:
        return False
    return arms_in is None or vehicle.custom_mode in arms_in


def _judge_arming(vehicle: "ScriptedVehicle", message: Message) -> int:
    """Arming needs readiness; disarming in the air needs the number that forces it."""
    if message.param1 == 0.0:
        denied = vehicle.airborne and message.param2 != FORCED
        is_px4 = vehicle.script.is_px4
        refusal = mavlink.MAV_RESULT_TEMPORARILY_REJECTED if is_px4 else mavlink.MAV_RESULT_FAILED
        return int(refusal if denied else mavlink.MAV_RESULT_ACCEPTED)
    if vehicle.is_ready and may_arm_here(vehicle):
        return int(mavlink.MAV_RESULT_ACCEPTED)
    if vehicle.script.arming_complaint:
        vehicle.send_status_text(vehicle.script.arming_complaint)
    return vehicle.script.arming_refusal


def _judge_pause(vehicle: "ScriptedVehicle") -> int:
    """ArduPilot pauses within AUTO and GUIDED only, and does not leave them."""
    pauses = not vehicle.script.is_copter or vehicle.custom_mode in {COPTER_AUTO, COPTER_GUIDED}
    return int(mavlink.MAV_RESULT_ACCEPTED if pauses else mavlink.MAV_RESULT_FAILED)


def _judge_start(vehicle: "ScriptedVehicle") -> int:
    if vehicle.script.is_infeasible:
        vehicle.send_status_text("Mission start denied! No valid mission\t")
        return int(mavlink.MAV_RESULT_DENIED)
    return _judge_mode(vehicle, COPTER_AUTO)


def _judge_mode(vehicle: "ScriptedVehicle", main: int, sub: int = 0) -> int:
    """ArduPilot's AUTO begins on the ground with a take-off only."""
    flies_items = main == COPTER_AUTO if vehicle.script.is_copter else (main, sub) == (4, 4)
    if flies_items and not vehicle.items and not vehicle.script.flies_without_items:
        denied = mavlink.MAV_RESULT_FAILED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        return int(denied[not vehicle.script.is_copter])
    if vehicle.script.is_infeasible and vehicle.armed and main == COPTER_GUIDED:
        return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)  # PX4's AUTO has the same number
    first = vehicle.script.home_is_item_0
    legs = [item for item in vehicle.items[first:] if item.command <= mavlink.MAV_CMD_NAV_LAST]
    takes_off = bool(legs) and legs[0].command == mavlink.MAV_CMD_NAV_TAKEOFF
    standing = vehicle.armed and not vehicle.airborne
    auto = vehicle.script.wants_takeoff_first and main == COPTER_AUTO
    if vehicle.script.is_copter and not vehicle.navigates:
        vehicle.send_status_text(
            "Mode change failed: requires position", mavlink.MAV_SEVERITY_WARNING
        )
        return int(mavlink.MAV_RESULT_FAILED)
    if auto and standing and not takes_off:
        vehicle.send_status_text("Auto: Missing Takeoff Cmd")
        return int(mavlink.MAV_RESULT_FAILED)
    return int(mavlink.MAV_RESULT_ACCEPTED)
