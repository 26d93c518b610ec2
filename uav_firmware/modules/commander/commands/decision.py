"""Decision on a command: a result, a text, and effects that the module carries out."""

from typing import NamedTuple, TypeAlias

from uav_firmware.msg.mission import ModeTarget, NavigatorRequest
from uav_firmware.msg.status import CommandResult, NavigationState


class SetMode(NamedTuple):
    """Change the mode."""

    state: NavigationState


class Arm(NamedTuple):
    """Arm the vehicle."""


class Disarm(NamedTuple):
    """Disarm the vehicle."""


class Terminate(NamedTuple):
    """Stop the motors in the air too (DO_FLIGHTTERMINATION)."""


class HoldFor(NamedTuple):
    """Hold for a time once at rest, then change to a mode."""

    seconds: float  # [s]
    then: NavigationState


class SetHome(NamedTuple):
    """Set home to a place, or to the present position."""

    place: tuple[float, float, float] | None  # [deg, deg, m AMSL] None: here
    yaw: float  # [rad] NaN: present heading


class RequestNavigator(NamedTuple):
    """Send a request to the navigator."""

    request: NavigatorRequest


class InjectFailure(NamedTuple):
    """Simulate the failure of a part; the numbers are MAVLink's."""

    unit: int  # [-] FAILURE_UNIT
    failure_type: int  # [-] FAILURE_TYPE; 0 ends the failure
    instance: int  # [-] From 1; 0 all


FlightEffect: TypeAlias = SetMode | HoldFor | Arm | Disarm | Terminate | SetHome | RequestNavigator
Effect: TypeAlias = FlightEffect | InjectFailure


class Decision(NamedTuple):
    """Answer to a command; without ACCEPTED there are no effects."""

    result: CommandResult
    reason: str = ""  # Text for the operator; may be empty
    effects: tuple[Effect, ...] = ()
    target: ModeTarget | None = (
        None  # ACCEPTED only if the geofence allows it; None: nothing to check
    )


def accepted(*effects: Effect, note: str = "", target: ModeTarget | None = None) -> Decision:
    """The command is carried out; with a target, if the geofence allows that."""
    return Decision(CommandResult.ACCEPTED, note, effects, target)


def denied(reason: str) -> Decision:
    """A parameter is wrong in any state."""
    return Decision(CommandResult.DENIED, reason)


def temporarily_rejected(reason: str) -> Decision:
    """The parameters are valid, but the state of the vehicle does not allow the command now."""
    return Decision(CommandResult.TEMPORARILY_REJECTED, reason)


def failed(reason: str) -> Decision:
    """The parameters are valid, but what the command acts on does not exist."""
    return Decision(CommandResult.FAILED, reason)
