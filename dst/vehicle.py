"""A fast kinematic multirotor that speaks the part of MAVLink 2 that the broker uses.

It follows PX4 where ground stations can tell: custom modes, missions stored as a whole, a take-over
by the pilot, a return at a low battery, disarming on the ground. Codec and geometry are its own:
what is wrong in the broker must not be right here by the same mistake. `truth` records what it did.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.scheduler import Event, Scheduler

HOME: Final = (40.44340, -3.73820, 650.0)
"""Latitude, longitude [deg], altitude above mean sea level [m]."""
_METRES_PER_DEGREE_NORTH: Final = 111_320.0
_METRES_PER_DEGREE_EAST: Final = _METRES_PER_DEGREE_NORTH * math.cos(math.radians(HOME[0]))

POSITION: Final = 3 << 16
HOLD, MISSION, RETURN, LAND = (4 << 16 | sub << 24 for sub in (3, 4, 5, 6))
"""PX4's custom modes."""
STEP_S: Final = 0.25
STREAM_S: Final = 0.5
"""The shortest interval of a stream: a slow radio, and a simulation that is fast."""
SPEED_M_S: Final = 5.0
CLIMB_M_S: Final = 2.0
ACCEPTANCE_M: Final = 1.0
LOW_BATTERY: Final = 0.15
FULL_BATTERY_S: Final = 1500.0
"""Flight time of a full battery."""
BOOT_S: Final = 4.0
"""From the start of the autopilot, which has then counted so far, to its first message."""
REPEAT_REQUEST_S: Final = 0.5
TRANSFER_TIMEOUT_S: Final = 5.0
HEALTHY: Final = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)
ORDERS: Final = frozenset(
    {
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_MISSION_START,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_NAV_TAKEOFF,
    }
)
"""Commands that move a vehicle."""


class Reached(NamedTuple):
    """A waypoint that was flown, by truth."""

    time_s: float
    latitude_e7: int
    longitude_e7: int


class OrderUnderPilot(NamedTuple):
    """An order that arrived while the pilot flew."""

    time_s: float
    pilot_since_s: float
    name: str


@dataclass
class Truth:
    """What a vehicle did, whatever anybody has learnt of it."""

    north_m: float = 0.0
    east_m: float = 0.0
    height_m: float = 0.0
    reached: list[Reached] = field(default_factory=list)
    orders_under_pilot: list[OrderUnderPilot] = field(default_factory=list)
    flight_s: float = 0.0


def place(north_m: float, east_m: float) -> tuple[float, float]:
    """Give the latitude and longitude [deg] of a place relative to home."""
    return HOME[0] + north_m / _METRES_PER_DEGREE_NORTH, HOME[1] + east_m / _METRES_PER_DEGREE_EAST


def _offset_m(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    return (
        (latitude_deg - HOME[0]) * _METRES_PER_DEGREE_NORTH,
        (longitude_deg - HOME[1]) * _METRES_PER_DEGREE_EAST,
    )


class Vehicle:
    """One vehicle with its autopilot, stepped by the scheduler."""

    def __init__(self, scheduler: Scheduler, system: int, send: Callable[[bytes], None]) -> None:
        """Stand at home, disarmed, with a full battery; `send` takes each frame."""
        self.system = system
        self.truth = Truth()
        self.armed = False
        self.mode = HOLD
        self.pilot_since_s: float | None = None
        self.battery = 1.0
        self.has_attitude = True
        self._in_failsafe = False
        self._scheduler = scheduler
        self._send_frame = send
        self._codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self.booted_at_s = scheduler.now_s
        self._plans: dict[int, list[Any]] = {}  # By MAV_MISSION_TYPE
        self._transfer: dict[int, Any] = {}
        self._transfer_count = 0
        self._transfer_type = 0
        self._transfer_at_s = 0.0
        self._started_s = 0.0  # Of the transfer, or its last progress
        self._current = 0
        self._is_complete = False
        self._target: tuple[float, float, float] | None = None
        self._speed_m_s = SPEED_M_S
        self._wait_until_s = 0.0
        self._periods_s: dict[int, float] = {}
        self._due_s: dict[int, float] = {}
        self._heartbeat_s = 0.0
        self._parameters = {"COM_DL_LOSS_T": 10.0, "BAT1_CAPACITY": 4200.0}
        self._next_step: Event | None = None
        self.switch_on()

    # Persons and faults.

    @property
    def is_flying(self) -> bool:
        """Whether it is off the ground."""
        return self.truth.height_m > 0.0

    def take_over(self) -> None:
        """Have the pilot fly."""
        self.pilot_since_s = self._scheduler.now_s
        self._set_mode(POSITION)

    def release(self) -> None:
        """Have the pilot land it and give it back."""
        self.pilot_since_s = None
        self._set_mode(LAND)

    def fail(self, *, lands: bool) -> None:
        """Have the autopilot's own failsafe land the vehicle, or return it, and say why."""
        self._in_failsafe = True
        self._set_mode(LAND if lands else RETURN)
        text = b"Failsafe activated: " + (b"position lost" if lands else b"motor failure")
        self._send(mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_CRITICAL, text))

    def reboot(self) -> None:
        """Restart the autopilot of a vehicle on the ground; the stored mission survives."""
        self.switch_off()
        self.booted_at_s = self._scheduler.now_s
        self._next_step = self._scheduler.after(BOOT_S, self._step_again)

    def switch_off(self) -> None:
        """End the autopilot, and whatever it sends, on the ground."""
        if self._next_step is not None:
            self._next_step.cancel()
        self._next_step = None
        self.armed, self.mode, self._in_failsafe = False, HOLD, False
        self._periods_s.clear()
        self._transfer_count = 0
        self._current = 0

    def switch_on(self) -> None:
        """Start the autopilot with a full battery; the stored mission survives."""
        self.reboot()
        self.battery = 1.0

    # Time.

    def _step_again(self) -> None:
        self._next_step = self._scheduler.after(STEP_S, self._step_again)
        self.step()

    def step(self) -> None:
        """Fly on, and send what is due."""
        now_s = self._scheduler.now_s
        if self.armed:
            self._fly()
        elif self.battery < 1.0:
            self.battery = min(1.0, self.battery + STEP_S / 120.0)
        if self._transfer_count and now_s - self._transfer_at_s > REPEAT_REQUEST_S:
            self._request_item()
        if now_s >= self._heartbeat_s:
            self._heartbeat_s = now_s + 1.0
            self._heartbeat()
        for message_id, period_s in self._periods_s.items():
            if now_s >= self._due_s[message_id]:
                self._due_s[message_id] = now_s + period_s
                self._send_stream(message_id)

    def _fly(self) -> None:
        truth = self.truth
        if self.is_flying:
            truth.flight_s += STEP_S
            self.battery = max(0.0, self.battery - STEP_S / FULL_BATTERY_S)
        if self.battery < LOW_BATTERY and self.mode in {MISSION, HOLD} and self.is_flying:
            self._set_mode(RETURN)
        if self.mode == MISSION:
            self._fly_item()
        elif self.mode == RETURN:
            if self._approach((0.0, 0.0, max(truth.height_m, 5.0))):
                self._set_mode(LAND)
        elif self.mode == LAND:
            self._descend()
        elif self._target is not None:
            self._approach(self._target)

    def _fly_item(self) -> None:  # noqa: C901  # a case per command of an item
        items = self._plans.get(0, [])
        if self._is_complete or self._current >= len(items):
            return
        item, truth = items[self._current], self.truth
        match item.command:
            case mavlink.MAV_CMD_NAV_TAKEOFF:
                if not self._approach((truth.north_m, truth.east_m, item.z)):
                    return
            case mavlink.MAV_CMD_NAV_WAYPOINT:
                north_m, east_m = _offset_m(item.x / 1e7, item.y / 1e7)
                if not self._approach((north_m, east_m, item.z)):
                    return
                if not self._has_waited(item.param1):
                    return
                truth.reached.append(Reached(self._scheduler.now_s, item.x, item.y))
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self._set_mode(RETURN)
            case mavlink.MAV_CMD_NAV_LAND:
                if self._descend():
                    self._item_done()
                return
            case mavlink.MAV_CMD_DO_CHANGE_SPEED:
                self._speed_m_s = item.param2 if item.param2 > 0.0 else SPEED_M_S
            case _:
                pass
        self._item_done()

    def _has_waited(self, hold_s: float) -> bool:
        if not hold_s > 0.0:
            return True
        now_s = self._scheduler.now_s
        if not self._wait_until_s:
            self._wait_until_s = now_s + hold_s
        if now_s < self._wait_until_s:
            return False
        self._wait_until_s = 0.0
        return True

    def _item_done(self) -> None:
        self._send(mavlink.MAVLink_mission_item_reached_message(self._current))
        if self._current + 1 < len(self._plans[0]):
            self._current += 1
        else:
            self._is_complete = True
        self._send_stream(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)

    def _approach(self, target: tuple[float, float, float]) -> bool:
        """Fly towards a place, first up; gives whether it is reached."""
        truth = self.truth
        north_m, east_m = target[0] - truth.north_m, target[1] - truth.east_m
        climb_m = target[2] - truth.height_m
        truth.height_m += math.copysign(min(abs(climb_m), CLIMB_M_S * STEP_S), climb_m)
        distance_m = math.hypot(north_m, east_m)
        if distance_m > 0.0:
            share = min(1.0, self._speed_m_s * STEP_S / distance_m)
            truth.north_m += share * north_m
            truth.east_m += share * east_m
        return distance_m < ACCEPTANCE_M and abs(climb_m) < ACCEPTANCE_M

    def _descend(self) -> bool:
        """Sink; gives whether it stands, and has disarmed."""
        self.truth.height_m = max(0.0, self.truth.height_m - 1.0 * STEP_S)
        if self.truth.height_m > 0.0:
            return False
        self._disarm()
        return True

    def _disarm(self) -> None:
        self.armed = self._in_failsafe = False
        self._speed_m_s = SPEED_M_S
        if self.mode != MISSION:
            self.mode = HOLD
        self._heartbeat()

    def _set_mode(self, mode: int) -> None:
        self.mode = mode
        self._target = None
        self._wait_until_s = 0.0
        self._scheduler.note(
            f"vehicle {self.system}", "-", f"mode {mode >> 16 & 0xFF}.{mode >> 24}"
        )
        self._heartbeat()

    # Messages to the broker.

    def _send(self, message: Any) -> None:
        frame = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        self._send_frame(bytes(frame))

    def _heartbeat(self) -> None:
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        base |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED if self.mode != POSITION else 0
        base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED if self.pilot_since_s is not None else 0
        kind, autopilot = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4
        state = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
        state = mavlink.MAV_STATE_CRITICAL if self._in_failsafe else state
        self._send(mavlink.MAVLink_heartbeat_message(kind, autopilot, base, self.mode, state, 3))

    @property
    def _boot_ms(self) -> int:
        return int((self._scheduler.now_s - self.booted_at_s) * 1e3)

    def _send_stream(self, message_id: int) -> None:
        makers: dict[int, Callable[[], Any]] = {
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._position,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: lambda: mavlink.MAVLink_attitude_message(
                self._boot_ms, *[0.0 if self.has_attitude else math.nan] * 6
            ),
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._landed,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: lambda: mavlink.MAVLink_sys_status_message(
                HEALTHY, HEALTHY, HEALTHY, 0, 12000, 100, round(self.battery * 100), *[0] * 6
            ),
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: lambda: mavlink.MAVLink_battery_status_message(
                0, 1, 1, 32767, [12000] + [65535] * 9, 100, 0, -1, round(self.battery * 100)
            ),
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home_position,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version,
        }
        if message_id in makers:
            self._send(makers[message_id]())

    def _position(self) -> Any:
        truth = self.truth
        latitude, longitude = place(truth.north_m, truth.east_m)
        height_mm = round(truth.height_m * 1e3)
        return mavlink.MAVLink_global_position_int_message(
            self._boot_ms,
            round(latitude * 1e7),
            round(longitude * 1e7),
            round(HOME[2] * 1e3) + height_mm,
            height_mm,
            *(0, 0, 0, 0),
        )

    def _landed(self) -> Any:
        flying, standing = mavlink.MAV_LANDED_STATE_IN_AIR, mavlink.MAV_LANDED_STATE_ON_GROUND
        return mavlink.MAVLink_extended_sys_state_message(0, flying if self.is_flying else standing)

    def _mission_current(self) -> Any:
        count = len(self._plans.get(0, []))
        if not count:
            state = mavlink.MISSION_STATE_NO_MISSION
        elif self._is_complete:
            state = mavlink.MISSION_STATE_COMPLETE
        elif self.mode == MISSION and self.armed:
            state = mavlink.MISSION_STATE_ACTIVE
        else:
            state = mavlink.MISSION_STATE_NOT_STARTED
        flies = 1 if self.mode == MISSION else 2
        return mavlink.MAVLink_mission_current_message(self._current, count, state, flies)

    def _home_position(self) -> Any:
        home = round(HOME[0] * 1e7), round(HOME[1] * 1e7), round(HOME[2] * 1e3)
        return mavlink.MAVLink_home_position_message(
            *home, *[0.0] * 3, [1.0, 0.0, 0.0, 0.0], *[0.0] * 3
        )

    def _version(self) -> Any:
        capabilities = (
            mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        )
        none = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(
            capabilities, 1 << 24 | 14 << 16, 0, 0, 0, none, none, none, 0, 0, self.system
        )

    # Messages from the broker.

    def receive(self, datagram: bytes) -> None:
        """Take a datagram; dropped if it is broken, or while the vehicle is off or boots."""
        is_booting = self._scheduler.now_s < self.booted_at_s + BOOT_S
        if self._next_step is not None and not is_booting:
            self._receive(datagram)

    def _receive(self, datagram: bytes) -> None:  # noqa: C901  # a case per message
        try:
            message = self._codec.decode(bytearray(datagram))
        except (mavlink.MAVError, IndexError):
            return
        if getattr(message, "target_system", self.system) not in {0, self.system}:
            return
        match message.get_type():
            case "COMMAND_LONG" | "COMMAND_INT":
                self._command(message)
            case "MISSION_COUNT":
                self._begin_transfer(message)
            case "MISSION_ITEM_INT":
                self._take_item(message)
            case "MISSION_REQUEST_LIST":
                kind = message.mission_type
                count = len(self._plans.get(kind, []))
                self._send(mavlink.MAVLink_mission_count_message(254, 191, count, kind))
            case "MISSION_REQUEST_INT" | "MISSION_REQUEST":
                self._send_item(message)
            case "MISSION_CLEAR_ALL":
                self._plans.pop(message.mission_type, None)
                self._acknowledge(mavlink.MAV_MISSION_ACCEPTED, message.mission_type)
            case "MISSION_SET_CURRENT":
                self._set_current(message.seq)
            case "PARAM_REQUEST_READ":
                self._send_parameter(message.param_id)
            case "PARAM_SET":
                if message.param_id in self._parameters:
                    self._parameters[message.param_id] = message.param_value
                self._send_parameter(message.param_id)

    def _send_parameter(self, name: str) -> None:
        if name in self._parameters:
            value, kind = self._parameters[name], mavlink.MAV_PARAM_TYPE_REAL32
            self._send(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 2, 0))

    def _acknowledge(self, result: int, kind: int) -> None:
        self._send(mavlink.MAVLink_mission_ack_message(254, 191, result, kind))

    def _begin_transfer(self, message: Any) -> None:
        self._note_order("MISSION_COUNT")
        self._transfer, self._transfer_type = {}, message.mission_type
        self._transfer_count = message.count
        if not message.count:
            self._plans.pop(message.mission_type, None)
            self._acknowledge(mavlink.MAV_MISSION_ACCEPTED, message.mission_type)
            return
        self._started_s = self._scheduler.now_s
        self._request_item()

    def _request_item(self) -> None:
        self._transfer_at_s = self._scheduler.now_s
        if self._transfer_at_s - self._started_s > TRANSFER_TIMEOUT_S:
            self._transfer_count = 0
            return
        seq, kind = len(self._transfer), self._transfer_type
        self._send(mavlink.MAVLink_mission_request_int_message(254, 191, seq, kind))

    def _take_item(self, message: Any) -> None:
        kind = message.mission_type
        if not self._transfer_count:
            if message.seq == len(self._plans.get(kind, [])) - 1:
                self._acknowledge(mavlink.MAV_MISSION_ACCEPTED, kind)
            return
        if kind != self._transfer_type:
            return
        if message.seq == len(self._transfer):
            self._transfer[message.seq] = message
            self._started_s = self._scheduler.now_s
        if len(self._transfer) < self._transfer_count:
            self._request_item()
            return
        self._plans[kind] = [self._transfer[seq] for seq in range(self._transfer_count)]
        self._transfer_count = 0
        if kind == mavlink.MAV_MISSION_TYPE_MISSION:
            self._current, self._is_complete = 0, False
        self._acknowledge(mavlink.MAV_MISSION_ACCEPTED, kind)

    def _send_item(self, message: Any) -> None:
        items = self._plans.get(message.mission_type, [])
        if message.seq < len(items):
            item = items[message.seq]
            item.target_system, item.target_component = 254, 191
            self._send(item)
        else:
            self._acknowledge(mavlink.MAV_MISSION_INVALID_SEQUENCE, message.mission_type)

    def _set_current(self, seq: int) -> None:
        if seq < len(self._plans.get(0, [])):
            self._current, self._is_complete = seq, False
        self._send_stream(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)

    def _note_order(self, name: str) -> None:
        if self.pilot_since_s is not None and self.armed:
            order = OrderUnderPilot(self._scheduler.now_s, self.pilot_since_s, name)
            self.truth.orders_under_pilot.append(order)

    def _command(self, message: Any) -> None:
        if message.command in ORDERS:
            self._note_order(mavlink.enums["MAV_CMD"][message.command].name)
        result = self._obey(message)
        self._send(mavlink.MAVLink_command_ack_message(message.command, result))

    def _obey(self, message: Any) -> int:  # noqa: C901, PLR0912  # a case per command
        accepted = int(mavlink.MAV_RESULT_ACCEPTED)
        match message.command:
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                return self._arm(is_on=message.param1 == 1.0)
            case mavlink.MAV_CMD_DO_SET_MODE:
                self._take_mode(int(message.param2) << 16 | int(message.param3) << 24)
            case mavlink.MAV_CMD_MISSION_START:
                if not self._plans.get(0):
                    return int(mavlink.MAV_RESULT_DENIED)
                self._take_mode(MISSION)
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE:
                self._take_mode(HOLD if message.param1 == 0.0 else MISSION)
            case mavlink.MAV_CMD_NAV_LAND:
                self._take_mode(LAND)
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self._take_mode(RETURN)
            case mavlink.MAV_CMD_DO_REPOSITION:
                self._take_mode(HOLD)
                north_m, east_m = _offset_m(message.x / 1e7, message.y / 1e7)
                self._target = north_m, east_m, message.z - HOME[2]
            case mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
                self._set_current(int(message.param1))
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                self._set_interval(int(message.param1), message.param2)
            case mavlink.MAV_CMD_REQUEST_MESSAGE:
                self._send_stream(int(message.param1))
            case mavlink.MAV_CMD_DO_CHANGE_SPEED:
                self._speed_m_s = message.param2
            case mavlink.MAV_CMD_RUN_PREARM_CHECKS:
                pass
            case _:
                return int(mavlink.MAV_RESULT_UNSUPPORTED)
        return accepted

    def _take_mode(self, mode: int) -> None:
        """Change the mode by command; the pilot's sticks have no precedence over it, as in PX4."""
        self.pilot_since_s = None
        self._in_failsafe = False
        if mode == MISSION and self.mode != MISSION and self._is_complete:
            self._current, self._is_complete = 0, False
        self._set_mode(mode)

    def _arm(self, *, is_on: bool) -> int:
        if is_on and self.battery < 2 * LOW_BATTERY:
            return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
        if not is_on and self.is_flying:
            return int(mavlink.MAV_RESULT_DENIED)
        self.armed = is_on
        self._heartbeat()
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _set_interval(self, message_id: int, interval_us: float) -> None:
        self._periods_s.pop(message_id, None)
        if interval_us >= 0.0:
            self._periods_s[message_id] = max(STREAM_S, interval_us * 1e-6)
            self._due_s[message_id] = self._scheduler.now_s
