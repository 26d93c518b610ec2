"""A vehicle's messages as the values that the cloud receives; unknown values stay absent.

Angles become degrees, yaw 0 to 360 clockwise from north; positions degrees; altitude metres
above home, as MAVLink's `relative_alt`; speed is the length of the whole velocity, m/s.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple, TypedDict

from afarcloud.state import Battery, Pose, StateVector
from mavlink_broker.mavlink.dialect import BOOT_MS_VALUES, Message, mavlink
from mavlink_broker.planning.situation import Home

_PREARM: Final = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_NAVIGABLE: Final = mavlink.EKF_POS_HORIZ_ABS | mavlink.EKF_PRED_POS_HORIZ_ABS
_MAXIMUM_SPEED_M_S: Final = 100.0
_EARLIEST_UTC_S: Final = 1_420_070_400.0
"""2015: a clock that shows less has not been set."""
_LATEST_UTC_S: Final = 4_102_444_800.0
"""2100: a clock that shows more has been set to something else than the time."""


_UNKNOWN_UINT8: Final = 255
_FIXES: Final[Mapping[int, str]] = {
    mavlink.GPS_FIX_TYPE_NO_GPS: "none",
    mavlink.GPS_FIX_TYPE_NO_FIX: "none",
    mavlink.GPS_FIX_TYPE_2D_FIX: "2d",
    mavlink.GPS_FIX_TYPE_3D_FIX: "3d",
    mavlink.GPS_FIX_TYPE_DGPS: "dgps",
    mavlink.GPS_FIX_TYPE_RTK_FLOAT: "rtk_float",
    mavlink.GPS_FIX_TYPE_RTK_FIXED: "rtk_fixed",
    mavlink.GPS_FIX_TYPE_STATIC: "static",
    mavlink.GPS_FIX_TYPE_PPP: "ppp",
}

HOME_TIMEOUT_S: Final = 20.0
"""How long a vehicle on the ground may take to send its home; some never do."""


class Position(NamedTuple):
    """Where the vehicle is and how fast it moves."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float  # Above home
    speed_m_s: float


class Attitude(NamedTuple):
    """How the vehicle lies, degrees."""

    yaw_deg: float  # [0, 360) clockwise from north
    pitch_deg: float
    roll_deg: float  # [-180, 180)


class _PoseFields(TypedDict):
    """The fields that poses and state vectors have in common."""

    latitude: float
    longitude: float
    altitude: float
    yaw: float
    pitch: float
    roll: float


class MissionNow(NamedTuple):
    """The newest MISSION_CURRENT."""

    seq: int
    state: int  # MISSION_STATE, 0 unknown
    mission_id: int  # 0 where the vehicle gives none


class GpsQuality(NamedTuple):
    """The newest GPS_RAW_INT."""

    fix: str
    satellites: int | None  # None: not reported


@dataclass(slots=True)
class Snapshot:
    """The newest of everything that one vehicle has sent."""

    armed: bool | None = None
    base_mode: int = 0
    custom_mode: int = 0
    in_failsafe: bool = False  # Its failsafe acts
    is_beyond_fence: bool = False
    changed_mode_at_fence: bool = False  # It was beyond its fence when it entered its mode
    heartbeats_in_mode: int = 0
    time_s: float | None = None  # The vehicle's own, since it was switched on
    booted_at_utc_s: float | None = None  # Since 1970; None: its time of day is not set
    position: Position | None = None
    attitude: Attitude | None = None
    home: Home | None = None
    home_amsl_m: float | None = None  # By its two altitudes, should it never send its home
    battery_fraction: float | None = None
    battery_capacity_ah: float | None = None
    battery_time_s: float | None = None  # As the vehicle estimates it
    gps: GpsQuality | None = None
    landed_state: int = mavlink.MAV_LANDED_STATE_UNDEFINED
    ready_to_arm: bool | None = None  # None: not reported
    passes_checks: bool = False  # The same, of a vehicle that reports passed checks only
    can_navigate: bool | None = None  # By its position estimate; None: not reported
    boot_ms: int = 0  # Newest time since boot as it came, which begins at 0 again after 2^32 ms
    rounds: int = 0  # How often it has
    has_estimate: bool = True  # Of its place, by ESTIMATOR_STATUS or EKF_STATUS_REPORT
    unhealthy: int = 0  # MAV_SYS_STATUS_SENSOR, present and enabled, by the newest SYS_STATUS
    has_gps: bool | None = None  # False: its receiver has failed; None: nothing received yet
    mission: MissionNow | None = None
    homeless_since: float | None = None  # On the ground, without a home position; by the broker

    @property
    def is_on_ground(self) -> bool:
        """Disarmed, and not known to be in the air."""
        grounded = {mavlink.MAV_LANDED_STATE_UNDEFINED, mavlink.MAV_LANDED_STATE_ON_GROUND}
        return self.armed is False and self.landed_state in grounded

    @property
    def lacks_position(self) -> bool:
        """Whether it cannot find a place: it has no estimate, or only dead reckoning."""
        return not (self.has_estimate and self.has_gps is not False)

    @property
    def knows_whether_placed(self) -> bool:
        """Whether its position and its sensors are known, as an order to a place needs."""
        return self.position is not None and self.has_gps is not None

    def since_boot_s(self, boot_ms: int) -> float:
        """Give a time since boot in seconds that go on where the counter ends, after 49.7 days.

        A frame that is late comes from before the end.
        """
        rounds = self.rounds
        if boot_ms - self.boot_ms > BOOT_MS_VALUES // 2:
            rounds = max(0, rounds - 1)
        elif self.boot_ms - boot_ms > BOOT_MS_VALUES // 2:
            rounds += 1
        return (boot_ms + rounds * BOOT_MS_VALUES) / 1e3

    def clock(self, boot_ms: int) -> float:
        """Note the newest time since boot; gives it as `since_boot_s` does."""
        time_s = self.since_boot_s(boot_ms)
        self.rounds, self.boot_ms = int(time_s * 1e3 + 0.5) // BOOT_MS_VALUES, boot_ms
        return time_s

    def take(self, message: Message) -> None:
        """Keep the values of a message; other kinds of message are ignored."""
        reader = _READERS.get(message.get_type())
        if reader is not None:
            reader(self, message)

    def assume_home(self, now: float, *, is_received: bool) -> None:
        """Use its position for home after `HOME_TIMEOUT_S` without HOME_POSITION.

        The difference of its two altitudes is home's. On the ground only, where the vehicle is
        about to set its home.
        """
        may_be_set = self.home is None and self.is_on_ground and is_received
        if self.position is None or not may_be_set:
            self.homeless_since = None
            return
        self.homeless_since = now if self.homeless_since is None else self.homeless_since
        if now - self.homeless_since >= HOME_TIMEOUT_S and self.home_amsl_m is not None:
            self.home = Home(*self.position[:2], self.home_amsl_m)

    def forget(self) -> None:
        """Drop what a restarted vehicle sends again; the battery's capacity is a constant."""
        fresh = Snapshot(battery_capacity_ah=self.battery_capacity_ah)
        for name in Snapshot.__slots__:
            setattr(self, name, getattr(fresh, name))


def _heartbeat(snapshot: Snapshot, message: Message) -> None:
    snapshot.heartbeats_in_mode += 1
    if message.custom_mode != snapshot.custom_mode:
        snapshot.changed_mode_at_fence = snapshot.is_beyond_fence
        snapshot.heartbeats_in_mode = 1
    snapshot.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    snapshot.base_mode = message.base_mode
    snapshot.custom_mode = message.custom_mode
    snapshot.in_failsafe = message.system_status == mavlink.MAV_STATE_CRITICAL


def _fence_status(snapshot: Snapshot, message: Message) -> None:
    """A breach may be received behind the heartbeat with the mode that follows from it."""
    was_beyond, snapshot.is_beyond_fence = snapshot.is_beyond_fence, message.breach_status != 0
    is_new = snapshot.is_beyond_fence and not was_beyond
    snapshot.changed_mode_at_fence |= is_new and snapshot.heartbeats_in_mode == 1


def _global_position(snapshot: Snapshot, message: Message) -> None:
    snapshot.time_s = snapshot.clock(message.time_boot_ms)
    if not _is_place(message.lat, message.lon):
        return
    snapshot.home_amsl_m = (message.alt - message.relative_alt) / 1e3
    snapshot.position = Position(
        latitude_deg=message.lat / 1e7,
        longitude_deg=message.lon / 1e7,
        altitude_m=message.relative_alt / 1e3,
        speed_m_s=math.hypot(message.vx, message.vy, message.vz) / 1e2,
    )


def _attitude(snapshot: Snapshot, message: Message) -> None:
    angles = (message.yaw, message.pitch, message.roll)
    if all(math.isfinite(angle) for angle in angles):
        yaw, pitch, roll = (math.degrees(angle) for angle in angles)
        snapshot.attitude = Attitude(
            _turn(yaw), max(-90.0, min(90.0, pitch)), _turn(roll + 180.0) - 180.0
        )


def _home(snapshot: Snapshot, message: Message) -> None:
    if _is_place(message.latitude, message.longitude):
        snapshot.home = Home(
            message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3
        )


def _battery(snapshot: Snapshot, message: Message) -> None:
    if message.id == 0:
        remaining = message.battery_remaining
        snapshot.battery_fraction = remaining / 100.0 if 0 <= remaining <= 100 else None
        time_s = message.time_remaining  # 0: the vehicle does not estimate it
        snapshot.battery_time_s = float(time_s) if time_s > 0 else None


def _gps(snapshot: Snapshot, message: Message) -> None:
    fix = _FIXES.get(message.fix_type, "unknown")
    satellites = message.satellites_visible
    snapshot.gps = GpsQuality(fix, satellites if satellites < _UNKNOWN_UINT8 else None)


def _system_time(snapshot: Snapshot, message: Message) -> None:
    utc_s = message.time_unix_usec / 1e6
    is_set = _EARLIEST_UTC_S <= utc_s < _LATEST_UTC_S
    since_boot_s = snapshot.since_boot_s(message.time_boot_ms)
    snapshot.booted_at_utc_s = utc_s - since_boot_s if is_set else None


def _extended_state(snapshot: Snapshot, message: Message) -> None:
    snapshot.landed_state = message.landed_state


def _system_status(snapshot: Snapshot, message: Message) -> None:
    """A check that is present but switched off (ARMING_CHECK = 0) shows nothing."""
    present = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
    healthy = bool(message.onboard_control_sensors_health & _PREARM)
    snapshot.passes_checks = healthy
    snapshot.unhealthy = present & ~message.onboard_control_sensors_health
    snapshot.has_gps = not (snapshot.unhealthy & mavlink.MAV_SYS_STATUS_SENSOR_GPS)
    snapshot.ready_to_arm = healthy if present & _PREARM else None


def _estimate(snapshot: Snapshot, message: Message) -> None:
    """ArduPilot navigates on the ground by a position that it has, or is sure to have."""
    snapshot.can_navigate = bool(message.flags & _NAVIGABLE)
    snapshot.has_estimate = snapshot.can_navigate


def _estimator(snapshot: Snapshot, message: Message) -> None:
    """PX4 sends the same in another message."""
    snapshot.has_estimate = bool(message.flags & mavlink.ESTIMATOR_POS_HORIZ_ABS)


def _mission_current(snapshot: Snapshot, message: Message) -> None:
    snapshot.mission = MissionNow(message.seq, message.mission_state, message.mission_id)


def _is_place(latitude_e7: int, longitude_e7: int) -> bool:
    """Refuse what is off the globe, and 0/0, which vehicles send before they have a fix."""
    on_globe = abs(latitude_e7) <= 900_000_000 and abs(longitude_e7) <= 1_800_000_000
    return on_globe and (latitude_e7 != 0 or longitude_e7 != 0)


def _turn(angle_deg: float) -> float:
    """Bring an angle to [0, 360); a tiny negative one plus a turn must not give 360."""
    turned = angle_deg % 360.0
    return 0.0 if turned >= 360.0 else turned


_READERS: Final[Mapping[str, Callable[[Snapshot, Message], None]]] = {
    "HEARTBEAT": _heartbeat,
    "FENCE_STATUS": _fence_status,
    "GLOBAL_POSITION_INT": _global_position,
    "ATTITUDE": _attitude,
    "HOME_POSITION": _home,
    "BATTERY_STATUS": _battery,
    "GPS_RAW_INT": _gps,
    "EXTENDED_SYS_STATE": _extended_state,
    "SYS_STATUS": _system_status,
    "EKF_STATUS_REPORT": _estimate,
    "ESTIMATOR_STATUS": _estimator,
    "SYSTEM_TIME": _system_time,
    "MISSION_CURRENT": _mission_current,
}


def pose(snapshot: Snapshot, *, vehicle_id: int, sequence_number: int) -> Pose | None:
    """Pose of the vehicle now; None while position or attitude is unknown."""
    if snapshot.position is None or snapshot.attitude is None:
        return None
    fields = _pose_fields(snapshot.position, snapshot.attitude)
    return Pose(sequence_number=sequence_number, vehicle_id=vehicle_id, **fields)


def _pose_fields(position: Position, attitude: Attitude) -> _PoseFields:
    """Position and attitude under AFarCloud's names."""
    return _PoseFields(
        latitude=position.latitude_deg,
        longitude=position.longitude_deg,
        altitude=position.altitude_m,
        yaw=attitude.yaw_deg,
        pitch=attitude.pitch_deg,
        roll=attitude.roll_deg,
    )


def battery(snapshot: Snapshot, *, vehicle_id: int, sequence_number: int) -> Battery | None:
    """Battery now; None while its charge or size is unknown."""
    if snapshot.battery_fraction is None or snapshot.battery_capacity_ah is None:
        return None
    return Battery(
        sequence_number=sequence_number,
        vehicle_id=vehicle_id,
        capacity=snapshot.battery_capacity_ah,
        percentage=snapshot.battery_fraction,
    )


def state_vector(
    snapshot: Snapshot, *, vehicle_id: int, sequence_number: int
) -> StateVector | None:
    """State vector now; None while position or attitude is unknown."""
    if snapshot.position is None or snapshot.attitude is None:
        return None
    return StateVector(
        sequence_number=sequence_number,
        vehicle_id=vehicle_id,
        **_pose_fields(snapshot.position, snapshot.attitude),
        battery_capacity=snapshot.battery_capacity_ah,
        battery_percentage=snapshot.battery_fraction,
        linear_speed=min(snapshot.position.speed_m_s, _MAXIMUM_SPEED_M_S),
    )


def has_long_uid(message: Message) -> bool:
    """Whether an AUTOPILOT_VERSION has the number of MAVLink 2, `uid2`."""
    return any(message.uid2)


def uid_of(message: Message) -> str:
    """Read AUTOPILOT_VERSION's number of the hardware: the long one, else the short one."""
    long_one = bytes(message.uid2).rstrip(b"\0")
    if long_one:
        return long_one.hex()
    return f"{message.uid:016x}" if message.uid else ""


def version(number: int) -> str | None:
    """Read AUTOPILOT_VERSION.flight_sw_version: major, minor and patch in its upper bytes."""
    if number == 0:
        return None
    return ".".join(str(number >> shift & 0xFF) for shift in (24, 16, 8))
