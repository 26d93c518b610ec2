"""A fast kinematic multirotor that speaks the part of MAVLink 2 that the broker uses.

It follows its autopilot family where ground stations can notice: custom modes, missions stored as a
whole, a takeover by the pilot, a return at a low battery, disarming on the ground. Its codec is its
own, as its geometry is.
"""

import math
from collections.abc import Callable
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.scheduler import Event, Scheduler
from dst.vehicles import telemetry
from dst.vehicles.autopilot import ORDERS, PX4, REPORTED_FROM_M, Autopilot, Mode
from dst.vehicles.flight import (
    HOME,
    SPEED_M_S,
    STEP_S,
    Arming,
    Circle,
    Flight,
    OrderUnderPilot,
    Truth,
    offset_m,
)
from dst.vehicles.mission_flight import ItemEnd, MissionFlight, circle_of
from dst.vehicles.mission_store import MissionStore
from dst.vehicles.pictures import COMPONENT, Camera, is_of_tracking

STREAMS_S: Final = (0.5, 1.0, 2.0, 3.0)
"""The shortest interval of a stream, one for each vehicle: slow radios, and a fast simulation."""
STANDING_STEP_S: Final = 0.5
"""Period of the steps of a vehicle that is not armed."""
CHARGE_S: Final = 120.0
"""Time in which a battery is charged."""
LOW_BATTERY: Final = 0.15
FULL_BATTERY_S: Final = 1500.0
"""Flight time of a full battery."""
DISARM_S: Final = 10.0
"""A vehicle that is armed and does not take off disarms after this time."""
BOOT_S: Final = 4.0
"""From the start of the autopilot, which has then counted so far, to its first message."""
SERIALS: Final = 1000  # To the serial number of the aircraft that takes its place


class Vehicle:
    """One vehicle with its autopilot, stepped by the scheduler."""

    def __init__(
        self,
        scheduler: Scheduler,
        system: int,
        send: Callable[[bytes], None],
        autopilot: Autopilot = PX4,
        *,
        has_camera: bool = False,
    ) -> None:
        """Stand at home, disarmed, with a full battery; `send` takes each frame."""
        self.system = system
        self.autopilot = autopilot
        self.parameters = dict(autopilot.parameters)
        self.armed = False
        self.mode = Mode.HOLD
        self._flight = Flight()
        self.pilot_since_s: float | None = None
        self.battery = 1.0
        self.spoiled: telemetry.Spoiled | None = None
        self.has_position = self.knows_battery = True
        self._in_failsafe = self._has_motor_failure = False
        self._scheduler = scheduler
        self._send_frame = send
        self.serial = system
        """Of the aircraft."""
        self._camera: Camera | None = None
        self._has_camera = has_camera
        self._yaw_rad = 0.0
        self._mount_camera()
        self._codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self.booted_at_s = scheduler.now_s
        self._missions = MissionStore(scheduler, self._send)
        self._mission = MissionFlight(scheduler, self._missions, self._flight, autopilot)
        self._target: tuple[float, float, float] | None = None
        self._circle: Circle | None = None
        self._armed_s = 0.0
        self._stream_s = scheduler.random(f"streams/{system}").choice(STREAMS_S)
        self._periods_s: dict[int, float] = {}
        self._due_s: dict[int, float] = {}
        self._heartbeat_s = 0.0
        self._next_step: Event | None = None
        self.switch_on()

    # Persons and faults.

    @property
    def truth(self) -> Truth:
        """What it did."""
        return self._flight.truth

    @property
    def is_flying(self) -> bool:
        """Whether it is off the ground."""
        return self.truth.height_m > 0.0

    @property
    def is_on(self) -> bool:
        """Whether its autopilot runs, or starts."""
        return self._next_step is not None

    def take_over(self) -> None:
        """Have the pilot fly."""
        self.pilot_since_s = self._scheduler.now_s
        self._set_mode(Mode.PILOT)

    def release(self) -> None:
        """Have the pilot land it and give it back."""
        self.pilot_since_s = None
        self._set_mode(Mode.LAND)

    def fail(self, *, lands: bool) -> None:
        """Have the autopilot's own failsafe land the vehicle, or return it, and say why."""
        self._in_failsafe = True
        if not lands and not self._has_motor_failure:
            self._has_motor_failure = True
            if self.truth.height_m > REPORTED_FROM_M:
                self.truth.motor_failures_s.append(self._scheduler.now_s)
        self._set_mode(Mode.LAND if lands else Mode.RETURN)
        text = b"Failsafe activated: " + (b"position lost" if lands else b"motor failure")
        self._send(mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_CRITICAL, text))

    def reboot(self) -> None:
        """Restart the autopilot; the stored mission and the parameters survive.

        A vehicle that flies falls, and stands where it was: nothing here breaks.
        """
        self.truth.height_m = 0.0
        self.pilot_since_s = None
        self.switch_off()
        self.booted_at_s = self._scheduler.now_s
        self._next_step = self._scheduler.after(BOOT_S, self._step_again)

    def swap(self) -> None:
        """Be another aircraft of the same family and system id, which has never flown here."""
        self.serial += SERIALS
        self._missions.forget()
        self.parameters = dict(self.autopilot.parameters)
        if self._camera is not None:
            self._camera.restart()
        self.truth.north_m = self.truth.east_m = 0.0
        self._mount_camera()
        self.switch_on()

    def _mount_camera(self) -> None:
        """Have a camera without pictures, if it has one."""
        self.truth.aircraft = self.serial
        if self._has_camera:
            frame, boot_ms = self._send_frame, lambda: self._boot_ms
            self._camera = Camera(self._scheduler, self.system, frame, self.truth, boot_ms)

    def switch_off(self) -> None:
        """End the autopilot, and whatever it sends."""
        if self._next_step is not None:
            self._next_step.cancel()
        self._next_step = None
        self.armed = self._in_failsafe = self._has_motor_failure = False
        self.mode = Mode.PILOT if self.autopilot.keeps_mode else Mode.HOLD
        self._target = self._circle = None
        self._flight.speed_m_s = SPEED_M_S
        self._periods_s.clear()
        self._missions.forget_transfer()
        self._mission.interrupt()
        self._mission.current = 0
        if self._camera is not None:
            self._camera.restart()

    def switch_on(self) -> None:
        """Start the autopilot with a full battery; the stored mission survives."""
        self.reboot()
        self.battery = 1.0

    @property
    def has_fence(self) -> bool:
        """Whether it holds a geofence; it begins without one."""
        return self._missions.has_fence

    # Time.

    def _step_again(self) -> None:
        period_s = STEP_S if self.armed else STANDING_STEP_S
        # Vehicles in step cost the broker one step
        until_s = period_s - self._scheduler.now_s % period_s
        self._next_step = self._scheduler.after(until_s, self._step_again)
        self.step()

    def step(self) -> None:
        """Fly on, and send what is due."""
        now_s = self._scheduler.now_s
        if self.armed:
            self._fly()
        elif self.battery < 1.0:
            self.battery = min(1.0, self.battery + STANDING_STEP_S / CHARGE_S)
        self._missions.tick()
        if now_s >= self._heartbeat_s:
            self._heartbeat_s = now_s + 1.0
            self._heartbeat()
            if self._camera is not None:
                self._camera.heartbeat()
        for message_id, period_s in self._periods_s.items():
            if now_s >= self._due_s[message_id]:
                # Streams of one interval are sent together
                self._due_s[message_id] = (now_s // period_s + 1.0) * period_s
                self._send_stream(message_id)

    def _fly(self) -> None:  # noqa: C901  # a case per mode
        truth = self.truth
        if self.is_flying:
            truth.flight_s += STEP_S
            self.battery = max(0.0, self.battery - STEP_S / FULL_BATTERY_S)
        elif self._scheduler.now_s - self._armed_s > DISARM_S:
            self._disarm()
            return
        is_returning = self.mode in {Mode.RETURN, Mode.LAND, Mode.PILOT}
        if self.battery < LOW_BATTERY and self.is_flying and not is_returning:
            self._set_mode(Mode.RETURN)
        if self.mode is Mode.MISSION:
            self._fly_item()
        elif self.mode is Mode.RETURN:
            if self._flight.come_home():
                self._disarm()
        elif self.mode is Mode.LAND:
            if self._flight.descend():
                self._disarm()
        elif self.mode is Mode.ORBIT and self._circle is not None:
            is_full = self._flight.turn(self._circle)
            if is_full and self.autopilot.counts_turns:
                self._set_mode(Mode.HOLD)
        elif self._target is not None:
            self._flight.approach(self._target)

    def _fly_item(self) -> None:
        end = self._mission.fly(self._camera)
        if end is None:
            return
        if end is ItemEnd.LANDED:
            self._disarm()
        elif end is ItemEnd.RETURNS:
            self._set_mode(Mode.RETURN)
        self._send(mavlink.MAVLink_mission_item_reached_message(self._mission.current))
        self._mission.advance()
        self._send_stream(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)

    def _disarm(self) -> None:
        self.armed = self._in_failsafe = self._has_motor_failure = False
        self._flight.speed_m_s = SPEED_M_S
        if self.mode is not Mode.MISSION and not self.autopilot.keeps_mode:
            self.mode = Mode.HOLD
        self._heartbeat()

    def _set_mode(self, mode: Mode) -> None:
        self.mode = mode
        self._target = self._circle = None
        self._mission.interrupt()
        aircraft = "" if self.serial == self.system else f" aircraft {self.serial}"
        self._scheduler.note(f"vehicle {self.system}{aircraft}", "-", f"mode {mode.name}")
        self._heartbeat()

    # Messages to the broker.

    def _send(self, message: Any) -> None:
        frame = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        self._send_frame(bytes(frame))

    def _heartbeat(self) -> None:
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        base |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED if self.mode is not Mode.PILOT else 0
        base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED if self.pilot_since_s is not None else 0
        kind, autopilot = mavlink.MAV_TYPE_QUADROTOR, self.autopilot.number
        mode = self.autopilot.modes[self.mode]
        state = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
        state = mavlink.MAV_STATE_CRITICAL if self._in_failsafe else state
        self._send(mavlink.MAVLink_heartbeat_message(kind, autopilot, base, mode, state, 3))

    @property
    def _boot_ms(self) -> int:
        return int((self._scheduler.now_s - self.booted_at_s) * 1e3)

    def _send_stream(self, message_id: int) -> None:
        makers: dict[int, Callable[[], Any]] = {
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._position,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: lambda: telemetry.attitude(
                self._boot_ms, self._yaw_rad
            ),
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: lambda: telemetry.gps(
                self._boot_ms, self.truth if self.has_position else None
            ),
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: lambda: telemetry.landed(
                is_flying=self.is_flying
            ),
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._system_status,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: lambda: telemetry.battery(self._known_battery),
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current,
            mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: telemetry.estimate,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: telemetry.home_position,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: lambda: telemetry.version(
                *self.autopilot.product, self.serial
            ),
        }
        if message_id in makers:
            self._send(telemetry.spoil(makers[message_id](), self.spoiled))

    @property
    def _known_battery(self) -> float | None:
        return self.battery if self.knows_battery else None

    def _system_status(self) -> Any:
        return telemetry.system_status(self._known_battery, is_motor_failed=self._has_motor_failure)

    def _position(self) -> Any:
        truth = self.truth if self.has_position else None
        return telemetry.position(self._boot_ms, self.truth.height_m, truth)

    def _mission_current(self) -> Any:
        return self._mission.message(is_flown=self.mode is Mode.MISSION, is_armed=self.armed)

    # Messages from the broker.

    def receive(self, datagram: bytes) -> None:
        """Handle a datagram; dropped if it is broken, or while the vehicle is off or boots."""
        is_booting = self._scheduler.now_s < self.booted_at_s + BOOT_S
        if self._next_step is not None and not is_booting:
            self._receive(datagram)

    def _receive(self, datagram: bytes) -> None:  # noqa: C901, PLR0912  # a case per message
        try:
            message = self._codec.decode(bytearray(datagram))
        except (mavlink.MAVError, IndexError):
            return
        if getattr(message, "target_system", self.system) not in {0, self.system}:
            return
        if getattr(message, "target_component", 1) == COMPONENT:
            if self._camera is not None:
                self._camera.receive(message)
            return
        if message.get_type() == "MISSION_COUNT":
            self._note_order("MISSION_COUNT")
        if self._missions.receive(message):
            self._mission.restart()
        match message.get_type():
            case "COMMAND_LONG" | "COMMAND_INT":
                self._command(message)
            case "MISSION_SET_CURRENT":
                self._set_current(message.seq)
            case "FOLLOW_TARGET" if self.mode is Mode.FOLLOW:
                north_m, east_m = offset_m(message.lat / 1e7, message.lon / 1e7)
                self._target = north_m, east_m, max(message.alt - HOME[2], 8.0)
            case "TIMESYNC" if message.tc1 == 0:
                own_ns = round(self._scheduler.now_s * 1e9)
                self._send(mavlink.MAVLink_timesync_message(own_ns, message.ts1))
            case "PARAM_REQUEST_READ":
                self._send_parameter(message.param_id)
            case "PARAM_SET":
                if message.param_id in self.parameters:
                    self.parameters[message.param_id] = message.param_value
                self._send_parameter(message.param_id)

    def _send_parameter(self, name: str) -> None:
        if name in self.parameters:
            value, kind = self.parameters[name], mavlink.MAV_PARAM_TYPE_REAL32
            count, index = len(self.parameters), list(self.parameters).index(name)
            answer = mavlink.MAVLink_param_value_message(name.encode(), value, kind, count, index)
            self._send(answer)

    def _set_current(self, seq: int) -> None:
        self._mission.select(seq)
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
        accepted, denied = int(mavlink.MAV_RESULT_ACCEPTED), int(mavlink.MAV_RESULT_DENIED)
        autopilot = self.autopilot
        match message.command:
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                return self._arm(is_on=message.param1 == 1.0)
            case mavlink.MAV_CMD_DO_SET_MODE:
                mode = autopilot.mode_of(int(message.param2), int(message.param3))
                if mode is None:
                    return denied
                self._take_mode(mode)
            case mavlink.MAV_CMD_MISSION_START:
                if not self._missions.items or not (self.armed or autopilot.starts_disarmed):
                    return denied
                self._take_mode(Mode.MISSION)
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE if autopilot.pauses_by_command:
                self._take_mode(Mode.HOLD if message.param1 == 0.0 else Mode.MISSION)
            case mavlink.MAV_CMD_NAV_LAND:
                self._take_mode(Mode.LAND)
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self._take_mode(Mode.RETURN)
            case mavlink.MAV_CMD_DO_REPOSITION:
                self._take_mode(Mode.HOLD)
                north_m, east_m = offset_m(message.x / 1e7, message.y / 1e7)
                self._target = north_m, east_m, message.z - HOME[2]
                self._yaw_rad = self._yaw_rad if math.isnan(message.param4) else message.param4
            case mavlink.MAV_CMD_CONDITION_YAW if autopilot.turns_by_condition:
                self._yaw_rad = math.remainder(math.radians(message.param1), math.tau)
            case mavlink.MAV_CMD_IMAGE_START_CAPTURE if self._camera is not None:
                self._camera.start(message.param2, int(message.param3), message.param4)
            case _ if self._camera is not None and is_of_tracking(message):
                return self._camera.obey_tracking(message)
            case mavlink.MAV_CMD_DO_ORBIT if autopilot.orbits and self.is_flying:
                self._take_mode(Mode.ORBIT)
                self._circle = circle_of(message, message.param1, message.param2)
            case mavlink.MAV_CMD_DO_FOLLOW if autopilot.counts_turns and self.is_flying:
                self._take_mode(Mode.FOLLOW)
                self.truth.place_e7 = None
            case mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
                self._set_current(int(message.param1))
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                self._set_interval(int(message.param1), message.param2)
            case mavlink.MAV_CMD_REQUEST_MESSAGE:
                self._send_stream(int(message.param1))
            case mavlink.MAV_CMD_DO_CHANGE_SPEED:
                self._flight.speed_m_s = message.param2 if message.param2 > 0.0 else SPEED_M_S
            case mavlink.MAV_CMD_RUN_PREARM_CHECKS:
                pass
            case _:
                return int(mavlink.MAV_RESULT_UNSUPPORTED)
        return accepted

    def _take_mode(self, mode: Mode) -> None:
        """Change the mode by command; the pilot's sticks have no precedence over it, as in PX4."""
        self.pilot_since_s = None
        self._in_failsafe = False
        if mode is Mode.MISSION and self.mode is not Mode.MISSION:
            # PX4 repeats the last item of a mission that it has completed in this flight
            is_over = self._mission.is_complete and not self.is_flying
            if is_over or self.parameters.get("MIS_RESTART") == 1.0:
                self._mission.current = 0
            self._mission.is_complete = False
        self._set_mode(mode)

    def _arm(self, *, is_on: bool) -> int:
        if is_on and (self.battery < 2 * LOW_BATTERY or self.mode not in self.autopilot.arms_in):
            return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
        if not is_on and self.is_flying:
            return int(mavlink.MAV_RESULT_DENIED)
        self._armed_s = self._scheduler.now_s
        if is_on and not self.armed:
            self.truth.armings.append(Arming(self._armed_s, self._missions.places_e7))
        self.armed = is_on
        self._heartbeat()
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _set_interval(self, message_id: int, interval_us: float) -> None:
        self._periods_s.pop(message_id, None)
        if interval_us >= 0.0:
            self._periods_s[message_id] = max(self._stream_s, interval_us * 1e-6)
            self._due_s[message_id] = 0.0
