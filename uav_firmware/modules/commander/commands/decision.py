"""What comes of a command: a result, a sentence, and effects for the module to carry out."""

from typing import NamedTuple, TypeAlias

from uav_firmware.msg.mission import NavigatorRequest
from uav_firmware.msg.status import CommandResult, NavigationState


class SetMode(NamedTuple):
    """Fly in another mode."""

    state: NavigationState


class Arm(NamedTuple):
    """Let the motors turn."""


class Disarm(NamedTuple):
    """Stop the motors."""


class Terminate(NamedTuple):
    """Stop the motors wherever the vehicle is, for good reasons only."""


class HoldFor(NamedTuple):
    """Hold for a time once at rest, then go on with a mode."""

    seconds: float  # [s]
    then: NavigationState


class SetHome(NamedTuple):
    """Put home at a place, or where the vehicle is."""

    place: tuple[float, float, float] | None  # [deg, deg, m AMSL] None: here
    yaw: float  # [rad] NaN: present heading


class Tell(NamedTuple):
    """Hand a request to the navigator."""

    request: NavigatorRequest


class Inject(NamedTuple):
    """Let a part of the vehicle fail; the numbers are MAVLink's."""

    unit: int  # [-] FAILURE_UNIT
    failure_type: int  # [-] FAILURE_TYPE; 0 mends
    instance: int  # [-] From 1; 0 all


FlightEffect: TypeAlias = SetMode | HoldFor | Arm | Disarm | Terminate | SetHome | Tell
Effect: TypeAlias = FlightEffect | Inject


class Decision(NamedTuple):
    """Answer to a command; without ACCEPTED there are no effects."""

    result: CommandResult
    reason: str = ""  # Sentence for the operator; empty when there is nothing to say
    effects: tuple[Effect, ...] = ()


def accepted(*effects: Effect, note: str = "") -> Decision:
    """The command is carried out."""
    return Decision(CommandResult.ACCEPTED, note, effects)


def denied(reason: str) -> Decision:
    """A parameter is wrong, whenever it is sent."""
    return Decision(CommandResult.DENIED, reason)


def not_now(reason: str) -> Decision:
    """Right, but at the wrong moment."""
    return Decision(CommandResult.TEMPORARILY_REJECTED, reason)


def failed(reason: str) -> Decision:
    """Right, but there is nothing that it could be done with."""
    return Decision(CommandResult.FAILED, reason)
