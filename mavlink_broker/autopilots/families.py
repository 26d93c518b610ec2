"""How families of autopilots differ, as tables; nothing else in the broker asks which one it is.

PX4's identity is shared by the project's own vehicle. An unknown autopilot gets the plain
protocol: arm, start the mission, judge nothing by its modes.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import Final

from afarcloud.enumerations import OrbitType
from mavlink_broker.autopilots import flight_modes, geofence_parameters, parameter_settings
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.autopilots.orbit_support import (
    ITEM_HEADINGS,
    OWN_HEADINGS,
    STANDARD_HEADINGS,
    Orbiting,
)
from mavlink_broker.autopilots.parameter_settings import Loans
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import CommandLong, long_command
from mavlink_broker.microservices.command_sequence import Ways
from mavlink_broker.microservices.parameter_write import ParameterEncoding


def _mode(main: int, sub: int = 0) -> CommandLong:
    """DO_SET_MODE(176) to a custom mode; PX4 takes main and sub, ArduPilot its number in main."""
    return long_command(
        mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub
    )


_ARM: Final = long_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
_START: Final = CommandLong(command=mavlink.MAV_CMD_MISSION_START)
_PAUSE: Final = CommandLong(command=mavlink.MAV_CMD_DO_PAUSE_CONTINUE)
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


_FOLLOW_OF_PX4: Final = _mode(4, 8)
_FOLLOW_OF_COPTER: Final = _mode(23)


_TO_A_PLACE: Final = frozenset(
    {
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_DO_ORBIT,
        mavlink.MAV_CMD_DO_FOLLOW,
        mavlink.MAV_CMD_MISSION_START,
    }
)
"""MAV_CMD that make a vehicle fly somewhere by its position."""


class Following(Enum):
    """How a vehicle is told to follow."""

    BY_COMMAND = auto()  # DO_FOLLOW
    BY_MODE = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """What is special about one family of autopilots."""

    name: str
    autopilot: str = "generic"  # As the edge server knows it
    home_is_item_0: bool = False  # The list begins with home, the mission with item 1
    takeoff_holds_position: bool = True  # Take-off climbs in place: a waypoint must follow
    yaw_by_condition: bool = False  # A yaw needs a CONDITION_YAW item before
    honours_acceptance_radius: bool = True
    honours_abort_altitude: bool = False
    honours_precision_landing: bool = True
    honours_landing_altitude: bool = True
    honours_video_frequency: bool = True
    kept_parameters: Mapping[int, frozenset[int]] = field(default_factory=dict)
    """Which of the first four parameters survive storage, per command; all where none is named."""
    whole_parameters: Mapping[int, frozenset[int]] = field(default_factory=dict)
    """Which of them are cut to whole numbers in storage."""
    hold_yaw_deg: float = 0.0  # Fourth parameter of a hold that asks for no heading
    gimbal_rate_deg_s: float = math.nan  # What says "no rate" beside a gimbal's angles
    arming: Ways = ((_ARM,),)
    starting: Ways = ((_START,),)
    readiness_by_mode: bool = False  # "Ready to arm" means: in the mode that it is in
    tells_only_passed_checks_since: int | None = None  # AUTOPILOT_VERSION.flight_sw_version
    tells_estimate: bool = False  # By EKF_STATUS_REPORT, when it can navigate
    runs_missions_disarmed: bool = False  # In its mission mode, whether its propellers turn or not
    arming_patience_s: float = 0.0  # A refusal to arm may pass: in its modes it checks other things
    holding: Ways = ((_PAUSE,),)  # Stay in the air, out of the mission
    landing: Ways = ((_LAND,),)  # Here and now
    returning: Ways = ((_RETURN,),)  # Home, and land there
    orbiting: Orbiting = Orbiting.ENDLESS
    orbit_headings: Mapping[OrbitType, float] = field(default_factory=lambda: STANDARD_HEADINGS)
    circle_rate_max_deg_s: float = math.inf  # Of its own circle
    starts_legs_anew: bool = False  # At its own speed, whatever was told before
    speed_by_order: bool = False  # A reposition brings none: DO_CHANGE_SPEED behind it does
    following: Following = Following.BY_COMMAND
    follow_modes: Ways = ()
    follow_loans: Callable[[float, float, int], Loans] = parameter_settings.nothing
    """For a height above home [m], an angle to the target's course [deg], our own system id."""
    lowest_follow_m: float = 0.0
    camera_is_autopilot: bool = False  # Camera commands go to the autopilot itself
    takes_panoramas: bool = False  # Its camera does, by PANORAMA_CREATE
    gimbal_slew_s: float = 0.0  # Its camera waits so long at most until its gimbal has turned
    busy_pause_s: float = 6.0  # After "busy": the vehicle's own idle timeout and a second
    battery_capacity_parameter: str | None = None  # In mAh
    link_loss_parameter: str | None = None  # Above 0 it wants a ground station to attend to it
    link_patience_parameter: str | None = None  # For how long it may be without one, s
    talks_to_stations_only: bool = False  # STATUSTEXT goes to who says that he is one
    # What keeps a vehicle within its fence, and the parameters that this has to know
    guard: geofence_parameters.Guard = geofence_parameters.guard_nothing
    guard_parameters: tuple[str, ...] = ()
    rally_altitude_step_m: float = 0.0  # To which a rally point's altitude is cut in storage
    parameter_encoding: ParameterEncoding = ParameterEncoding.C_CAST  # Of one that tells none
    mode_name: Callable[[int, int], str] = flight_modes.generic_name
    mode_role: Callable[[str], ModeRole] = flight_modes.generic_role

    def leads_to_a_place(self, message: Message) -> bool:
        """Whether an order takes the vehicle to a place or round one, so that it needs a position.

        Modes count as this family's orders to return, follow and start set them.
        """
        if message.get_type() not in {"COMMAND_LONG", "COMMAND_INT"}:
            return False
        if message.command != mavlink.MAV_CMD_DO_SET_MODE:
            return message.command in _TO_A_PLACE
        mode = message.param1, message.param2, message.param3
        ways = (*self.returning, *self.follow_modes, *self.starting)
        return any(
            isinstance(order, CommandLong)
            and (order.command, order.parameters[:3]) == (message.command, mode)
            for way in ways
            for order in way
        )

    @property
    def knows_modes(self) -> bool:
        """Whether its modes can be told apart."""
        return self.mode_role is not flight_modes.generic_role


PX4: Final = Family(
    name="px4",
    autopilot="px4",
    kept_parameters={
        mavlink.MAV_CMD_NAV_WAYPOINT: frozenset({0, 1, 3}),
        mavlink.MAV_CMD_NAV_TAKEOFF: frozenset({3}),
        mavlink.MAV_CMD_NAV_LAND: frozenset({1, 3}),
        mavlink.MAV_CMD_NAV_LOITER_UNLIM: frozenset({2, 3}),
    },
    hold_yaw_deg=math.nan,
    readiness_by_mode=True,
    tells_only_passed_checks_since=0x010E0000,
    arming_patience_s=20.0,
    arming=((_ARM,), (_PX4_MISSION_MODE, _ARM)),
    starting=((_START,), (_PX4_MISSION_MODE,)),
    holding=((_PX4_HOLD,), (_PAUSE,)),
    landing=((_PX4_LAND,), (_LAND,)),
    returning=((_PX4_RETURN,), (_RETURN,)),
    following=Following.BY_MODE,
    follow_modes=((_FOLLOW_OF_PX4,),),
    follow_loans=parameter_settings.px4_follow,
    lowest_follow_m=parameter_settings.PX4_LOWEST_FOLLOW_M,
    battery_capacity_parameter="BAT1_CAPACITY",
    link_loss_parameter="NAV_DLL_ACT",
    link_patience_parameter="COM_DL_LOSS_T",
    talks_to_stations_only=True,
    guard=geofence_parameters.guard_px4,
    guard_parameters=geofence_parameters.PX4_NAMES,
    parameter_encoding=ParameterEncoding.BYTEWISE,
    mode_name=flight_modes.px4_name,
    mode_role=flight_modes.px4_role,
)

OWN: Final = replace(
    PX4,
    name="farm-flight",
    kept_parameters={},
    orbiting=Orbiting.COUNTED,
    orbit_headings=OWN_HEADINGS,
    following=Following.BY_COMMAND,
    follow_loans=parameter_settings.own_follow,
    lowest_follow_m=0.0,
    arming_patience_s=0.0,
    talks_to_stations_only=False,
    takes_panoramas=True,
    gimbal_slew_s=2.5,  # Half a turn at MNT_SLEW_MAX
)
"""The project's own vehicle, which is PX4 to everybody who does not look at its vendor."""

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
    kept_parameters={
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
    whole_parameters={
        mavlink.MAV_CMD_NAV_WAYPOINT: frozenset({0}),
        mavlink.MAV_CMD_NAV_LAND: frozenset({0}),
        mavlink.MAV_CMD_NAV_LOITER_TURNS: frozenset({0, 2}),
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: frozenset({0, 1}),
        mavlink.MAV_CMD_IMAGE_START_CAPTURE: frozenset({0, 2}),
    },
    gimbal_rate_deg_s=0.0,  # It refuses every other NaN than a yaw, and goes by the angles
    landing=((_COPTER_LAND,), (_LAND,)),
    returning=((_COPTER_RETURN,), (_RETURN,)),
    orbiting=Orbiting.BY_ITEM,
    orbit_headings=ITEM_HEADINGS,
    circle_rate_max_deg_s=20.0,  # CIRCLE_RATE's default, of which AUTO makes no other use
    starts_legs_anew=True,
    speed_by_order=True,
    following=Following.BY_MODE,
    follow_modes=((_FOLLOW_OF_COPTER,),),
    follow_loans=parameter_settings.copter_follow,
    camera_is_autopilot=True,
    tells_estimate=True,
    runs_missions_disarmed=True,
    arming_patience_s=20.0,
    arming=((_COPTER_GUIDED, _ARM),),
    starting=((_START,), (_COPTER_AUTO,)),
    holding=((_COPTER_GUIDED,), (_PAUSE,)),
    busy_pause_s=9.0,
    battery_capacity_parameter="BATT_CAPACITY",
    guard=geofence_parameters.guard_ardupilot,
    guard_parameters=geofence_parameters.ARDUPILOT_NAMES,
    rally_altitude_step_m=1.0,
    mode_name=flight_modes.copter_name,
    mode_role=flight_modes.copter_role,
)

GENERIC: Final = Family(name="generic", battery_capacity_parameter="BAT1_CAPACITY")

ARDUPILOT_OTHER: Final = replace(
    ARDUPILOT,
    name="ardupilot-other",
    runs_missions_disarmed=False,
    arming=GENERIC.arming,
    starting=GENERIC.starting,
    holding=GENERIC.holding,
    landing=GENERIC.landing,
    returning=GENERIC.returning,
    follow_modes=(),
    mode_name=flight_modes.generic_name,
    mode_role=flight_modes.generic_role,
)
"""ArduPilot that is no copter: its missions, and nothing that depends on a number of a mode."""

MOST_ABLE: Final = OWN
"""Flies whatever any family flies: what it cannot, nobody can."""

FAMILIES: Final[Mapping[int, Family]] = {
    mavlink.MAV_AUTOPILOT_PX4: PX4,
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ARDUPILOT,
}
"""By HEARTBEAT.autopilot."""


OWN_PRODUCT: Final = (0x1209, 0x0001)
"""Vendor and product in AUTOPILOT_VERSION by which the project's own vehicle is told."""


_COPTERS: Final = frozenset(
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
"""MAV_TYPE of what flies ArduCopter; its numbers of modes mean other things to a plane or rover."""


def family_of(
    autopilot: int, product: tuple[int, int] | None = None, vehicle_type: int | None = None
) -> Family:
    """Family of a MAV_AUTOPILOT; `product` is vendor and product, if the vehicle has told it.

    `vehicle_type` is its MAV_TYPE; a copter unless it says otherwise.
    """
    family = FAMILIES.get(autopilot, GENERIC)
    if family is ARDUPILOT and vehicle_type not in {None, *_COPTERS}:
        return ARDUPILOT_OTHER
    return OWN if family is PX4 and product == OWN_PRODUCT else family
