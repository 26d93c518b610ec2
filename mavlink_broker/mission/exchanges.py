"""The protocol that runs with the vehicle in each state, built from the plan and the vehicle."""

from collections.abc import Sequence
from typing import Protocol, TypeAlias

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import (
    CommandAlternatives,
    CommandOutcome,
    CommandSequence,
    long_command,
)
from mavlink_broker.microservices.mission_download import MissionVerify, VerifyOutcome
from mavlink_broker.microservices.mission_protocol import supports_only_float_items
from mavlink_broker.microservices.mission_set_current import MissionSetCurrent
from mavlink_broker.microservices.mission_upload import MissionUpload, UploadOutcome
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.planning.read_back import difference
from mavlink_broker.vehicle.vehicle import Vehicle

Outcome: TypeAlias = UploadOutcome | VerifyOutcome | CommandOutcome


class Exchange(Protocol):
    """A protocol that runs with the vehicle and has an outcome."""

    @property
    def outcome(self) -> Outcome | None:
        """How it ended; None while it runs."""

    def start(self, now: float) -> list[Message]:
        """Begin."""

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle."""

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
        as_floats=supports_only_float_items(vehicle.capabilities),
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

    floats = supports_only_float_items(vehicle.capabilities)
    return MissionVerify(opaque_id, compare, vehicle.route, vehicle.round_trip, as_floats=floats)


def recognition(plan: FlightPlan, vehicle: Vehicle) -> MissionVerify:
    """Find out whether the vehicle holds the plan since an earlier run of the broker."""

    def compare(messages: Sequence[Message]) -> str | None:
        return difference(plan, messages, vehicle.family, home_may_have_moved=True)

    floats = supports_only_float_items(vehicle.capabilities)
    return MissionVerify(0, compare, vehicle.route, vehicle.round_trip, as_floats=floats)


def selection(plan: FlightPlan, vehicle: Vehicle) -> MissionSetCurrent:
    """Make the first item the current one."""
    first = plan.first_item
    shown_as = range(first, plan.first_leg + 1)
    return MissionSetCurrent(first, vehicle.route, vehicle.round_trip, shown_as=shown_as)


def hold_on_ground(vehicle: Vehicle) -> Message:
    """Ask for the family's hold mode; only the vehicle's next heartbeat shows whether it accepted.

    A vehicle of which only the mode is wrong is not ready to arm in it.
    """
    return vehicle.family.holding[0][0].message(vehicle.route, 0)


def arming_checks(vehicle: Vehicle) -> Message:
    """Request the arming checks; failed ones arrive as status texts."""
    return long_command(mavlink.MAV_CMD_RUN_PREARM_CHECKS).message(vehicle.route, 0)


def disarming(vehicle: Vehicle) -> list[Message]:
    """Stop the propellers of a vehicle on the ground that will not be flown; never in the air.

    One that reports itself disarmed is ordered too: its answer to the order to arm comes before
    its next heartbeat, and that order may not have arrived yet.
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


def repetition(alternatives: CommandAlternatives, vehicle: Vehicle) -> Message:
    """Repeat the first command of the first alternative, marked as a repetition."""
    return alternatives[0][0].message(vehicle.route, 1)


def commands(alternatives: CommandAlternatives, vehicle: Vehicle) -> CommandSequence:
    """Order by the family's alternatives, one after the other."""
    return CommandSequence(alternatives, vehicle.route, vehicle.round_trip)
