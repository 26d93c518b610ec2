"""Differences between autopilot families, as one table; no other module tests for a family.

The project's own vehicle identifies as PX4. An unknown autopilot gets the standard protocol: arm,
start the mission; its modes are not interpreted.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import Final

from afarcloud.enumerations import OrbitType
from mavlink_broker.autopilots import parameter_settings
from mavlink_broker.autopilots.flight_modes import (
    COPTER_ROLES,
    PX4_ROLES,
    ModeRole,
    copter_name,
    generic_name,
    px4_name,
)
from mavlink_broker.autopilots.parameter_settings import Following, ParameterOverrides
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import CommandAlternatives, CommandLong, long_command
from mavlink_broker.microservices.parameter import ParameterEncoding


def _mode(main: int, sub: int = 0) -> CommandLong:
    """DO_SET_MODE(176) to a custom mode; PX4 takes main and sub, ArduPilot its number in main."""
    return long_command(
        mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub
    )


_ARM: Final = long_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
_START: Final = CommandLong(command=mavlink.MAV_CMD_MISSION_START)
_PAUSE: Final = CommandLong(command=mavlink.MAV_CMD_DO_PAUSE_CONTINUE)
_CONTINUE: Final = long_command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 1.0)
_LAND: Final = long_command(
    mavlink.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan
)
_RETURN: Final = long_command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
_PX4_RETURN: Final = _mode(4, 5)
_PX4_LAND: Final = _mode(4, 6)
_COPTER_RETURN: Final = _mode(6)
_COPTER_LAND: Final = _mode(9)
_PX4_HOLD: Final = _mode(4, 3)
_PX4_MISSION_MODE: Final = _mode(4, 4)
_COPTER_AUTO: Final = _mode(3)
_COPTER_GUIDED: Final = _mode(4)
_COPTER_BRAKE: Final = _mode(17)
_PX4_FOLLOW: Final = _mode(4, 8)
_COPTER_FOLLOW: Final = _mode(23)
_POSITION_COMMANDS: Final = frozenset(
    {
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_DO_ORBIT,
        mavlink.MAV_CMD_DO_FOLLOW,
        mavlink.MAV_CMD_MISSION_START,
    }
)
"""MAV_CMDs for which a vehicle needs its position."""


class OrbitMethod(Enum):
    """How a vehicle orbits a point."""

    COUNTED = auto()  # DO_ORBIT with an angle, after which it holds
    ENDLESS = auto()  # DO_ORBIT until the next command
    BY_ITEM = auto()  # NAV_LOITER_TURNS in a mission


STANDARD_HEADINGS: Final[Mapping[OrbitType, float]] = {
    OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS: 3.0,
    OrbitType.TOWARDS_HOT_POINT: 0.0,
    OrbitType.CONTROLLED_BY_REMOTE_CONTROLLER: 4.0,
    OrbitType.USING_INITIAL_HEADING: 1.0,
}
"""ORBIT_YAW_BEHAVIOUR, the third parameter of DO_ORBIT."""
ITEM_HEADINGS: Final = {
    OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS: 3.0,
    OrbitType.TOWARDS_HOT_POINT: 0.0,
}
"""Headings of a circle in a mission: along it by a parameter, inwards by a ROI."""
FARM_FLIGHT_HEADINGS: Final = {
    **STANDARD_HEADINGS,
    OrbitType.ALONG_CIRCLE_LOOKING_BACKWARDS: 6.0,
    OrbitType.AWAY_FROM_HOT_POINT: 7.0,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """The properties of one autopilot family."""

    name: str
    autopilot: str = "generic"  # Name in the edge server's interface
    home_is_item_0: bool = False  # The list starts with home, the mission with item 1
    yaw_by_condition: bool = False  # A yaw needs a CONDITION_YAW item before it
    honours_acceptance_radius: bool = True
    honours_abort_altitude: bool = False
    honours_precision_landing: bool = True
    honours_landing_altitude: bool = True
    honours_video_frequency: bool = True
    stored_parameters: Mapping[int, frozenset[int]] = field(default_factory=dict)
    """Which of the first four parameters are stored, per command; all for other commands."""
    truncated_parameters: Mapping[int, frozenset[int]] = field(default_factory=dict)
    """Which of them are truncated to whole numbers in storage."""
    hold_yaw_deg: float = 0.0  # Fourth parameter of a hold without a heading
    gimbal_rate_deg_s: float = math.nan  # Means "no rate" with a gimbal's angles
    gimbal_flags: float = 0.0  # GIMBAL_MANAGER_FLAGS with every direction
    missions_take_gimbal: bool = True  # Else an item takes control of it before one points it
    accepts_modes_early: tuple[int, int] | None = None  # From a version, and up to another one
    arming: CommandAlternatives = ((_ARM,),)
    starting: CommandAlternatives = ((_START,),)
    readiness_by_mode: bool = False  # "Ready to arm" refers to its current mode
    reports_only_passed_checks_since: int | None = None  # AUTOPILOT_VERSION.flight_sw_version
    reports_estimator: bool = False  # EKF_STATUS_REPORT shows when it can navigate
    repeats_pictures: bool = False  # It resumes at the place before, if it has taken pictures
    reset_resumes: bool = False  # DO_SET_MISSION_CURRENT with a reset begins in any mode
    runs_missions_disarmed: bool = False  # In its mission mode, also before its propellers turn
    arming_retry_s: float = 0.0  # A refusal to arm may pass: in its modes it checks other things
    holding: CommandAlternatives = ((_PAUSE,),)  # Stay in the air, out of the mission
    pausing: CommandAlternatives = ((_PAUSE,),)  # Stop now, whatever is flown
    resuming: CommandAlternatives = ((_CONTINUE,),)  # Fly on with the mission items
    paused_mode: str | None = None  # Mode to which pausing leads, if no other order does
    return_item_mode: str | None = None  # Mode in which it flies an item that returns, if another
    landing: CommandAlternatives = ((_LAND,),)  # Here and now
    returning: CommandAlternatives = ((_RETURN,),)  # Home, and land there
    orbiting: OrbitMethod = OrbitMethod.ENDLESS
    orbit_headings: Mapping[OrbitType, float] = field(default_factory=lambda: STANDARD_HEADINGS)
    circle_rate_max_deg_s: float = math.inf  # Of its own circle
    limits_horizontal_speed: bool = True  # DO_CHANGE_SPEED leaves out the climb of a leg
    resets_speed_each_leg: bool = False  # To its default, whatever was set before
    speed_by_command: bool = False  # DO_CHANGE_SPEED after a reposition, which has no speed
    follows_by_command: bool = True  # DO_FOLLOW starts it, or else one of these modes
    follow_modes: CommandAlternatives = ()
    mission_overrides: ParameterOverrides = ()  # Parameters that every mission needs
    follow_overrides: Callable[[Following], ParameterOverrides] = parameter_settings.no_overrides
    lowest_follow_m: float = 0.0
    slowest_follow_m_s: float = 0.0  # Its own limit cannot be set below that
    camera_is_autopilot: bool = False  # Camera commands go to the autopilot itself
    takes_panoramas: bool = False  # Its camera supports PANORAMA_CREATE
    gimbal_slew_s: float = 0.0
    """Longest time that its camera waits for its gimbal; 0: it does not, its mission waits."""
    busy_pause_s: float = 6.0  # After "busy": the vehicle's own idle timeout and a second
    lists_log_ends: bool = False  # LOG_ENTRY.time_utc is a log's last change, not its beginning
    keeps_log_open: bool = False  # An interrupted log, though its number is another one's by now
    battery_capacity_parameter: str | None = None  # In mAh
    link_loss_parameter: str | None = None  # Above 0 it requires a ground station
    link_timeout_parameter: str | None = None  # For how long it may be without one, s
    status_texts_to_gcs_only: bool = False  # It sends STATUSTEXT to ground stations only
    fence_parameters: parameter_settings.FenceLaw = parameter_settings.unknown_fence
    fence_parameter_names: tuple[str, ...] = ()  # To be read for the geofence
    fence_switch: tuple[str, str] | None = None
    """The parameter that enables its fence, and the one by which it enables it itself, once."""
    parameters_since: Mapping[str, int] = field(default_factory=dict)
    """First version that has a parameter."""
    rally_altitude_step_m: float = 0.0  # Resolution of a rally point's altitude in storage
    parameter_encoding: ParameterEncoding = ParameterEncoding.C_CAST  # If it reports none
    mode_name: Callable[[int, int], str] = generic_name
    mode_roles: Mapping[str, ModeRole] | None = None  # None: its modes are not known

    def needs_position(self, message: Message) -> bool:
        """Whether an order takes the vehicle to a place or round one, so that it needs a position.

        Modes count as this family's orders to return, follow and start set them.
        """
        if message.get_type() not in {"COMMAND_LONG", "COMMAND_INT"}:
            return False
        if message.command != mavlink.MAV_CMD_DO_SET_MODE:
            return message.command in _POSITION_COMMANDS
        mode = message.param1, message.param2, message.param3
        alternatives = (*self.returning, *self.follow_modes, *self.starting)
        return any(
            isinstance(command, CommandLong)
            and (command.command, command.parameters[:3]) == (message.command, mode)
            for alternative in alternatives
            for command in alternative
        )

    @property
    def knows_modes(self) -> bool:
        """Whether its modes are known."""
        return self.mode_roles is not None

    def mode_role(self, name: str) -> ModeRole:
        """Role of a mode; all count as flying the mission if they are not known."""
        roles = self.mode_roles
        return ModeRole.MISSION if roles is None else roles.get(name, ModeRole.OTHER)


PX4: Final = Family(
    name="px4",
    autopilot="px4",
    stored_parameters={
        mavlink.MAV_CMD_NAV_WAYPOINT: frozenset({0, 1, 3}),
        mavlink.MAV_CMD_NAV_TAKEOFF: frozenset({3}),
        mavlink.MAV_CMD_NAV_LAND: frozenset({1, 3}),
        mavlink.MAV_CMD_NAV_LOITER_UNLIM: frozenset({2, 3}),
    },
    hold_yaw_deg=math.nan,
    gimbal_flags=float(
        mavlink.GIMBAL_MANAGER_FLAGS_ROLL_LOCK | mavlink.GIMBAL_MANAGER_FLAGS_PITCH_LOCK
    ),  # Else its angles count from the vehicle's, which tilts
    repeats_pictures=True,
    missions_take_gimbal=False,  # And it gives up control whenever it leaves its mission
    readiness_by_mode=True,
    reports_only_passed_checks_since=0x010E0000,
    arming_retry_s=20.0,
    accepts_modes_early=(0x01100000, 0x01120000),  # 1.16 and 1.17; the last of them no longer do
    arming=((_ARM,), (_PX4_MISSION_MODE, _ARM)),
    starting=((_START,), (_PX4_MISSION_MODE,)),
    holding=((_PX4_HOLD,), (_PAUSE,)),
    pausing=((_PX4_HOLD,), (_PAUSE,)),
    resuming=((_PX4_MISSION_MODE,), (_CONTINUE,)),
    return_item_mode="AUTO.RTL",
    landing=((_PX4_LAND,), (_LAND,)),
    returning=((_PX4_RETURN,), (_RETURN,)),
    follows_by_command=False,
    follow_modes=((_PX4_FOLLOW,),),
    follow_overrides=parameter_settings.px4_follow,
    lowest_follow_m=parameter_settings.PX4_LOWEST_FOLLOW_M,
    lists_log_ends=True,
    keeps_log_open=True,
    battery_capacity_parameter="BAT1_CAPACITY",
    link_loss_parameter="NAV_DLL_ACT",
    link_timeout_parameter="COM_DL_LOSS_T",
    status_texts_to_gcs_only=True,
    fence_parameters=parameter_settings.px4_fence,
    fence_parameter_names=parameter_settings.PX4_NAMES,
    parameter_encoding=ParameterEncoding.BYTEWISE,
    mode_name=px4_name,
    mode_roles=PX4_ROLES,
)

OWN: Final = replace(
    PX4,
    name="farm-flight",
    stored_parameters={},
    orbiting=OrbitMethod.COUNTED,
    return_item_mode=None,
    limits_horizontal_speed=False,
    orbit_headings=FARM_FLIGHT_HEADINGS,
    follows_by_command=True,
    follow_overrides=parameter_settings.farm_flight_follow,
    slowest_follow_m_s=parameter_settings.SLOWEST_FOLLOW_M_S,
    lowest_follow_m=0.0,
    lists_log_ends=False,
    keeps_log_open=False,
    arming_retry_s=0.0,
    gimbal_flags=0.0,
    repeats_pictures=False,
    missions_take_gimbal=True,
    accepts_modes_early=None,
    status_texts_to_gcs_only=False,
    takes_panoramas=True,
    gimbal_slew_s=2.5,  # Half a turn at MNT_SLEW_MAX
)
"""The project's own vehicle, which identifies as PX4 except by its vendor and product."""

ARDUPILOT: Final = Family(
    name="ardupilot",
    autopilot="ardupilot",
    home_is_item_0=True,
    yaw_by_condition=True,
    honours_acceptance_radius=False,
    honours_abort_altitude=True,
    honours_precision_landing=False,
    honours_landing_altitude=False,
    honours_video_frequency=False,
    stored_parameters={
        mavlink.MAV_CMD_NAV_WAYPOINT: frozenset({0}),
        mavlink.MAV_CMD_NAV_TAKEOFF: frozenset(),  # A pitch below 0 comes back as 65536 and less
        mavlink.MAV_CMD_NAV_LAND: frozenset({0}),
        mavlink.MAV_CMD_NAV_LOITER_UNLIM: frozenset(),
        mavlink.MAV_CMD_NAV_LOITER_TURNS: frozenset({0, 2}),
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION: frozenset(),
        mavlink.MAV_CMD_NAV_DELAY: frozenset({0}),
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: frozenset({0, 1}),
        mavlink.MAV_CMD_IMAGE_START_CAPTURE: frozenset({0, 1, 2}),
        mavlink.MAV_CMD_VIDEO_START_CAPTURE: frozenset({0}),
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE: frozenset({0}),
    },
    truncated_parameters={
        mavlink.MAV_CMD_NAV_WAYPOINT: frozenset({0}),
        mavlink.MAV_CMD_NAV_LAND: frozenset({0}),
        mavlink.MAV_CMD_NAV_LOITER_TURNS: frozenset({0, 2}),
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: frozenset({0, 1}),
        mavlink.MAV_CMD_IMAGE_START_CAPTURE: frozenset({0, 2}),
    },
    gimbal_rate_deg_s=0.0,  # It refuses every other NaN than a yaw, and goes by the angles
    landing=((_COPTER_LAND,), (_LAND,)),
    returning=((_COPTER_RETURN,), (_RETURN,)),
    orbiting=OrbitMethod.BY_ITEM,
    orbit_headings=ITEM_HEADINGS,
    circle_rate_max_deg_s=20.0,  # CIRCLE_RATE's default, of which AUTO makes no other use
    resets_speed_each_leg=True,
    speed_by_command=True,
    mission_overrides=parameter_settings.ARDUPILOT_MISSION,
    follows_by_command=False,
    follow_modes=((_COPTER_FOLLOW,),),
    follow_overrides=parameter_settings.copter_follow,
    camera_is_autopilot=True,
    reports_estimator=True,
    reset_resumes=True,
    runs_missions_disarmed=True,
    arming_retry_s=20.0,
    arming=((_COPTER_GUIDED, _ARM),),
    starting=((_START,), (_COPTER_AUTO,)),
    holding=((_COPTER_GUIDED,), (_PAUSE,)),
    pausing=((_COPTER_BRAKE,), (_PAUSE,)),  # A second GUIDED would fly on to its old place
    resuming=((_COPTER_AUTO,), (_CONTINUE,)),
    paused_mode="BRAKE",
    lists_log_ends=True,
    busy_pause_s=9.0,
    battery_capacity_parameter="BATT_CAPACITY",
    fence_parameters=parameter_settings.ardupilot_fence,
    fence_parameter_names=parameter_settings.ARDUPILOT_NAMES,
    fence_switch=("FENCE_ENABLE", "FENCE_AUTOENABLE"),
    parameters_since=parameter_settings.COPTER_SINCE,
    rally_altitude_step_m=1.0,
    mode_name=copter_name,
    mode_roles=COPTER_ROLES,
)

GENERIC: Final = Family(name="generic", battery_capacity_parameter="BAT1_CAPACITY")

ARDUPILOT_OTHER: Final = replace(
    ARDUPILOT,
    name="ardupilot-other",
    parameters_since={},
    runs_missions_disarmed=False,
    arming=GENERIC.arming,
    starting=GENERIC.starting,
    holding=GENERIC.holding,
    pausing=GENERIC.pausing,
    resuming=GENERIC.resuming,
    paused_mode=None,
    landing=GENERIC.landing,
    returning=GENERIC.returning,
    follow_modes=(),
    mode_name=generic_name,
    mode_roles=None,
)
"""ArduPilot other than copter: its missions, and nothing that depends on a mode number."""

MOST_CAPABLE: Final = OWN
"""The family that supports every command that any family supports."""

FAMILIES: Final[Mapping[int, Family]] = {
    mavlink.MAV_AUTOPILOT_PX4: PX4,
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ARDUPILOT,
}
"""By HEARTBEAT.autopilot."""

OWN_PRODUCT: Final = (0x1209, 0x0001)
"""Vendor and product in AUTOPILOT_VERSION of the project's own vehicle."""

_COPTER_TYPES: Final = frozenset(
    {
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_HELICOPTER,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
        mavlink.MAV_TYPE_GENERIC_MULTIROTOR,
    }
)
"""MAV_TYPEs of ArduCopter; its mode numbers have other meanings on a plane or rover."""


def family_of(autopilot: int, product: tuple[int, int] | None, vehicle_type: int | None) -> Family:
    """Family of a MAV_AUTOPILOT; `product` is vendor and product, if the vehicle has reported them.

    `vehicle_type` is its MAV_TYPE; None counts as a copter.
    """
    family = FAMILIES.get(autopilot, GENERIC)
    if family is ARDUPILOT and vehicle_type not in {None, *_COPTER_TYPES}:
        return ARDUPILOT_OTHER
    return OWN if family is PX4 and product == OWN_PRODUCT else family
