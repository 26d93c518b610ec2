"""The protocol that each state of a flight is busy with, built from the plan and the vehicle."""

from collections.abc import Sequence
from typing import Protocol, TypeAlias

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import CommandOutcome, long_command
from mavlink_broker.microservices.command_sequence import CommandSequence, Ways
from mavlink_broker.microservices.float_items import floats_only
from mavlink_broker.microservices.mission_select import MissionSelect
from mavlink_broker.microservices.mission_upload import MissionUpload, UploadOutcome
from mavlink_broker.microservices.mission_verify import MissionVerify, VerifyOutcome
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.planning.read_back import difference
from mavlink_broker.vehicle.vehicle import Vehicle

Outcome: TypeAlias = UploadOutcome | VerifyOutcome | CommandOutcome


class Activity(Protocol):
    """What the protocols of the states have in common."""

    @property
    def outcome(self) -> Outcome | None:
        """How it ended; None while it runs."""

    def start(self, now: float) -> list[Message]:
        """Begin."""

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""


def upload(plan: FlightPlan, vehicle: Vehicle) -> MissionUpload:
    """Put the plan onto the vehicle."""
    route = vehicle.route
    return MissionUpload(
        plan.messages(route.target_system, route.target_component),
        route,
        vehicle.round_trip,
        busy_pause_s=vehicle.family.busy_pause_s,
        as_floats=floats_only(vehicle.capabilities),
    )


def cancellation(vehicle: Vehicle) -> Message:
    """End an upload in the middle: the vehicle keeps what it had."""
    route = vehicle.route
    return mavlink.MAVLink_mission_ack_message(
        route.target_system, route.target_component, mavlink.MAV_MISSION_OPERATION_CANCELLED
    )


def verification(plan: FlightPlan, vehicle: Vehicle, opaque_id: int) -> MissionVerify:
    """Prove that the vehicle holds the plan; without an id, by reading it back."""

    def compare(messages: Sequence[Message]) -> str | None:
        return difference(plan, messages, vehicle.family)

    floats = floats_only(vehicle.capabilities)
    return MissionVerify(opaque_id, compare, vehicle.route, vehicle.round_trip, as_floats=floats)


def recognition(plan: FlightPlan, vehicle: Vehicle) -> MissionVerify:
    """Find out whether the vehicle holds the plan since an earlier run of the broker."""

    def compare(messages: Sequence[Message]) -> str | None:
        return difference(plan, messages, vehicle.family, home_may_have_moved=True)

    floats = floats_only(vehicle.capabilities)
    return MissionVerify(0, compare, vehicle.route, vehicle.round_trip, as_floats=floats)


def selection(plan: FlightPlan, vehicle: Vehicle) -> MissionSelect:
    """Make the first item the current one."""
    first = plan.first_item
    shown_as = range(first, plan.first_leg + 1)
    return MissionSelect(first, vehicle.route, vehicle.round_trip, shown_as=shown_as)


def hold_on_ground(vehicle: Vehicle) -> Message:
    """Ask for the family's hold mode; only the vehicle's next heartbeat tells whether it took it.

    A vehicle of which only the mode is wrong is not ready to arm in it.
    """
    return vehicle.family.holding[0][0].message(vehicle.route, 0)


def arming_checks(vehicle: Vehicle) -> Message:
    """Ask for the checks before arming to be made and told anew; what fails comes as texts."""
    return long_command(mavlink.MAV_CMD_RUN_PREARM_CHECKS).message(vehicle.route, 0)


def disarming(vehicle: Vehicle) -> list[Message]:
    """Stop the propellers of a vehicle that stands and will not be flown; never in the air.

    One that reports itself disarmed is ordered too: its answer to the order to arm comes before
    its next heartbeat, and that order may still be on its way.
    It leaves its mission mode too: whoever arms it next would fly off on what has failed.
    """
    snapshot = vehicle.snapshot
    if snapshot.landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND:
        return []
    would_fly = vehicle.mode_role is ModeRole.MISSION and vehicle.family.knows_modes
    order = long_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0).message(vehicle.route, 0)
    return [*([hold_on_ground(vehicle)] if would_fly else []), order]


def parking(vehicle: Vehicle) -> list[Message]:
    """Disarm what drives or swims, once its mission is over: it does not do so by itself."""
    if not vehicle.stays_on_ground or not vehicle.snapshot.armed:
        return []
    disarm = long_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
    return [disarm.message(vehicle.route, 0), disarm.message(vehicle.route, 1)]


def repetition(ways: Ways, vehicle: Vehicle) -> Message:
    """Say the first command of the first way once more, marked as a repetition."""
    return ways[0][0].message(vehicle.route, 1)


def commands(ways: Ways, vehicle: Vehicle) -> CommandSequence:
    """Arm or start, in the family's ways."""
    return CommandSequence(ways, vehicle.route, vehicle.round_trip)
