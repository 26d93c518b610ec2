"""State of the vehicle as a whole, commands to it and their answers."""

from enum import IntEnum
from typing import Final, NamedTuple


class NavigationState(IntEnum):
    """Flight modes; the names are PX4's. `mavlink` maps them to custom_mode."""

    MANUAL = 0
    ALTCTL = 1
    POSCTL = 2
    AUTO_MISSION = 3
    AUTO_LOITER = 4
    AUTO_RTL = 5
    ACRO = 10
    TERMINATION = 13
    OFFBOARD = 14
    STAB = 15
    AUTO_TAKEOFF = 17
    AUTO_LAND = 18
    AUTO_FOLLOW_TARGET = 19
    AUTO_PRECLAND = 20
    ORBIT = 21


class LandedState(IntEnum):
    """MAVLink's MAV_LANDED_STATE."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class Command(IntEnum):
    """MAVLink's MAV_CMD of the commands that commander answers."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    DO_FOLLOW = 32
    DO_ORBIT = 34
    CONDITION_YAW = 115
    DO_SET_MODE = 176
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_FLIGHTTERMINATION = 185
    DO_REPOSITION = 192
    DO_PAUSE_CONTINUE = 193
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    DO_SET_ROI = 201
    DO_FENCE_ENABLE = 207
    DO_SET_MISSION_CURRENT = 224
    MISSION_START = 300
    COMPONENT_ARM_DISARM = 400
    RUN_PREARM_CHECKS = 401
    INJECT_FAILURE = 420


class CommandResult(IntEnum):
    """MAVLink's MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5
    CANCELLED = 6


class VehicleStatus(NamedTuple):
    """Written by commander at 2 Hz and on change; read by all."""

    time_us: int  # [us]
    armed: bool
    navigation_state: NavigationState
    failsafe: bool  # A failsafe action flies the vehicle
    preflight_checks_pass: bool  # Arming would be accepted; armed: as healthy as it asks for
    armed_since_us: int  # [us] 0 when disarmed
    sensors_present: int  # [-] MAV_SYS_STATUS_SENSOR bits
    sensors_enabled: int  # [-]
    sensors_health: int  # [-]
    airborne_since_us: int = 0  # [us] 0 on the ground and while disarmed
    failures_cleared_us: int = 0  # [us] When the operator last acknowledged latched failures


class LandDetected(NamedTuple):
    """Written by land_detector on change and at 1 Hz; read by commander and mavlink."""

    time_us: int  # [us]
    landed: bool
    ground_contact: bool
    landed_state: LandedState
    has_low_throttle: bool  # Disarmed, or so little thrust that no rotor lifts the vehicle


class HomePosition(NamedTuple):
    """Where return ends. Written by commander at arming and on command."""

    time_us: int  # [us]
    latitude_deg: float  # [deg]
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    position_ned: tuple[float, float, float]  # [m] About the local origin
    yaw: float  # [rad] Heading at the time of setting


class VehicleCommand(NamedTuple):
    """A command to the vehicle, from a link or from a module; read by commander.

    `param5` and `param6` are degrees when the command carries a position; NaN means unset.
    """

    time_us: int  # [us]
    command: int  # [-] MAV_CMD
    param1: float
    param2: float
    param3: float
    param4: float
    param5: float
    param6: float
    param7: float
    frame: int  # [-] MAV_FRAME of param7: 0 AMSL (COMMAND_LONG), 3 relative to home
    source_system: int  # [-] 0 when the vehicle itself commands
    source_component: int  # [-]
    token: int  # [-] Copied into the answer; the link's key to route it


PROGRESS_UNKNOWN: Final = 255
"""Progress of a command that reports none, as in COMMAND_ACK."""


class VehicleCommandAck(NamedTuple):
    """Answer to a VehicleCommand; exactly one final one each. Read by mavlink."""

    time_us: int  # [us]
    command: int  # [-] MAV_CMD
    result: int  # [-] MAV_RESULT; 5 in progress is not final
    progress: int  # [%] With result 5; PROGRESS_UNKNOWN
    token: int  # [-] Of the command answered


class Severity(IntEnum):
    """MAVLink's MAV_SEVERITY, as far as the vehicle uses it."""

    EMERGENCY = 0
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class StatusText(NamedTuple):
    """A sentence for the operator. Written by any module, read by mavlink and logger."""

    time_us: int  # [us]
    severity: int  # [-] MAV_SEVERITY: 0 emergency to 7 debug
    text: str


class InternalErrors(NamedTuple):
    """Modules that have raised an error since the start.

    Written for each module by its error boundary; read by commander.
    """

    time_us: int  # [us]
    modules: tuple[str, ...]  # Names of rate groups, in the order of their first errors


class ParameterSaveRequest(NamedTuple):
    """A request to store the parameters now. Written by mavlink; read by parameter_storage."""

    request_id: int  # [-] Repeated in the result


class ParameterSaveResult(NamedTuple):
    """Answer to a ParameterSaveRequest. Written by parameter_storage; read by mavlink.

    The write may still be in progress: the control loop does not wait for a medium.
    """

    request_id: int  # [-] Of the request
    fault: str  # Why the write could not start, or the last one failed; empty on success


class StorageStatus(NamedTuple):
    """The medium of the flight log. Written by logger every 2 s; read by commander."""

    time_us: int  # [us]
    free_bytes: int  # [bytes] 0 when the medium does not report it
    refused: bool  # It has refused the log of this flight
