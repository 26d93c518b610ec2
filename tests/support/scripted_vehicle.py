"""A vehicle that behaves on the link as its script sets: PX4-like or ArduPilot-like.

Every item takes a fixed time; a landing ends on the ground and disarmed. It receives and sends
frames only, in simulated time.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass

from tests.support.geodesy import LocalGround
from tests.support.px4_gimbal import Px4Gimbal, Sender
from tests.support.scripted_missions import ARDUPILOT, PX4, Script, ScriptedMissions
from tests.support.scripted_streams import TELEMETRY_S, ScriptedStreams
from tests.support.vehicle_wire import Message, VehicleWire, mavlink, with_plan_ids

__all__ = ["ARDUPILOT", "PX4", "Script", "ScriptedVehicle"]

HOME = (40.44340, -3.73820, 650.0)
PX4_HOLD = 4 << 16 | 3 << 24
PX4_MISSION = 4 << 16 | 4 << 24
PX4_RETURN = 4 << 16 | 5 << 24
PX4_LAND = 4 << 16 | 6 << 24
PX4_POSITION = 3 << 16
PX4_ORBIT = 3 << 16 | 1 << 24
PX4_FOLLOW = 4 << 16 | 8 << 24
PLACE = ("param5", "param6", "param7")
COPTER_GUIDED = 4
COPTER_AUTO = 3
COPTER_RETURN = 6
COPTER_LAND = 9
LANDING_S = 8.0
STATION_S = 5.0
"""Time for which a ground station counts as present after its heartbeat."""
FORCED = 21196.0
"""Second parameter of MAV_CMD_COMPONENT_ARM_DISARM that disarms in the air."""
SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_GEOFENCE
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_PROPULSION
)
WHOLE = frozenset({"COM_DL_LOSS_T"})
"""Settings that PX4 keeps as whole numbers, and sends by their bits."""
WHOLE_AS_FLOATS = {
    "BATT_CAPACITY": mavlink.MAV_PARAM_TYPE_INT32,
    "MIS_RESTART": mavlink.MAV_PARAM_TYPE_INT8,
}
"""The same of ArduPilot, which sends them as floats."""
CAMERA_COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
        mavlink.MAV_CMD_CAMERA_TRACK_POINT,
        mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE,
        mavlink.MAV_CMD_CAMERA_STOP_TRACKING,
    }
)
GIMBAL_COMMANDS = frozenset(
    {mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE}
)


@dataclass
class Circle:
    """A circle that is being flown, from its northernmost point."""

    centre: tuple[float, float]
    radius_m: float  # Negative: counter-clockwise
    speed_m_s: float
    angle_rad: float  # To fly; infinite: until another order
    flown_rad: float = 0.0

    def after(self, seconds: float) -> tuple[float, float]:
        """Fly on; gives the new place."""
        self.flown_rad += self.speed_m_s / abs(self.radius_m) * seconds
        bearing = math.copysign(self.flown_rad, self.radius_m)
        radius_m = abs(self.radius_m)
        ground = LocalGround(*self.centre)
        return ground.place(radius_m * math.cos(bearing), radius_m * math.sin(bearing))

    @property
    def is_complete(self) -> bool:
        return self.flown_rad >= self.angle_rad


@dataclass(frozen=True)
class Target:
    """The place that a DO_REPOSITION names."""

    latitude_deg: float
    longitude_deg: float
    relative_altitude_m: float
    ground_speed_m_s: float


class ScriptedVehicle:
    """One vehicle."""

    def __init__(self, system: int, script: Script = PX4, *, booted_at: float = 0.0) -> None:
        self.system = system
        self.missions = ScriptedMissions(script, self._send, self._mission_stored)
        self.missions.busy_until = booted_at + script.busy_for_s
        self.missions.complain = self._complain
        self.armed = False
        self.airborne = False
        self.in_failsafe = False
        self.is_manual = False  # Flown manually; shown by the standard bit of the base mode
        self.frames: list[Message] = []  # Everything that was sent to it
        self._has_lost_current = False
        self.custom_mode = self._first_mode
        self.current = 0
        self.mission_state = mavlink.MISSION_STATE_NO_MISSION
        self.commands: list[int] = []
        self.arm_orders = 0
        """How often it was ordered to arm, disarming left out."""
        self.parameters: list[tuple[int, tuple[float, ...]]] = []
        self.begun_early: list[int] = []  # MAV_CMDs of items that began outside of the mission mode
        self.silent = False
        self.gimbal = Px4Gimbal(system)
        self.resumed_at: list[int] = []  # Items, earlier than those at which it had paused
        self.restarted_at: list[int] = []  # Items at which it was when it began at its first again
        self.lost_answers: set[int] = set()  # Commands that are obeyed, their answers lost
        self.ignores_intervals = False
        self.settings = dict(script.settings)
        self.written: list[tuple[str, float]] = []  # Parameters, as they were set
        self.yaw_rad = -math.pi / 2
        self.home = HOME
        self.place = HOME[:2]
        self.height_m = 5.0
        self.circle: Circle | None = None
        self.velocity_ned = (0.0, 0.0, 0.0)
        self._target: Target | None = None
        self.ill = 0  # MAV_SYS_STATUS_SENSOR that are not healthy
        self.targets = 0  # FOLLOW_TARGET received
        self.last_target = HOME[:2]
        self.clock_wraps_at_ms: int | None = None  # None: `time_boot_ms` never wraps
        self.booted_at = booted_at  # When it was switched on, by the world's clock
        self._now = booted_at
        self._wire = VehicleWire(system, 1)
        self._outbox: list[bytes] = []
        self._streams = ScriptedStreams(
            unasked=script.streams_unasked, mission_every_s=script.mission_every_s, now=booted_at
        )
        self._later: list[tuple[float, Message]] = []
        self._disarm_at = math.inf
        self._attended_at = -math.inf  # By a ground station
        self._stepped_at = booted_at
        self._item_began_at = 0.0
        self._mode_began_at = 0.0
        self._next = {"heartbeat": booted_at, "telemetry": booted_at}

    @property
    def script(self) -> Script:
        """How it behaves; may be changed at any time."""
        return self.missions.script

    @script.setter
    def script(self, script: Script) -> None:
        self.missions.script = script

    @property
    def items(self) -> list[Message]:
        """The stored mission."""
        return self.missions.items

    @items.setter
    def items(self, items: list[Message]) -> None:
        self.missions.items = items

    @property
    def uploads(self) -> int:
        """How many missions were stored."""
        return self.missions.uploads

    # Called by the world.

    def receive(self, datagram: bytes, now: float) -> None:
        """Process a datagram of the broker."""
        self._now = now
        for message in self._wire.decode(datagram):
            if getattr(message, "target_system", self.system) in {0, self.system}:
                self.frames.append(message)
                self.missions.handle(message, now)
                self._handle(message)

    def step(self, now: float) -> list[bytes]:
        """Advance to a time; returns the frames to send."""
        self._now = now
        self._fly()
        self._reposition(max(0.0, now - self._stepped_at))
        self._stepped_at = now
        if self.armed and self.airborne and not self._attended and self.in_mission:
            self.set_mode(PX4_RETURN)
        self.missions.tick(now)
        if now >= self._next["heartbeat"]:
            self._next["heartbeat"] = now + 1.0
            self.heartbeat()
        if now >= self._next["telemetry"]:
            self._next["telemetry"] = now + TELEMETRY_S
            self._go_round()
            self._come_down()
        if now >= self._disarm_at:
            self._disarm()
        self._answer_later(now)
        self._telemetry()
        frames, self._outbox = self._outbox, []
        return [] if self.silent else frames

    def reboot(self, now: float) -> None:
        """Start anew on the ground; the stored mission survives, clock and mode do not."""
        self.armed = self.airborne = False
        self.custom_mode = self._first_mode
        self.booted_at = now
        self._next = {"heartbeat": now, "telemetry": now}
        self._streams.restart(now)
        self.missions.drop_transfer()
        self.mission_state = mavlink.MISSION_STATE_NOT_STARTED
        self.current = 0

    def store_foreign_mission(
        self, items: list[Message], *, acknowledged_to: int | None = None
    ) -> None:
        """Hold the mission of another ground station; others may receive its acknowledgement."""
        self.items = items
        if acknowledged_to is not None:
            self._send(mavlink.MAVLink_mission_ack_message(acknowledged_to, 190, 0))

    def clear_mission(self, *, acknowledged_to: int | None = None) -> None:
        """Hold no mission, as a ground station's MISSION_CLEAR_ALL has ordered."""
        self.store_foreign_mission([], acknowledged_to=acknowledged_to)
        self.mission_state, self.current = mavlink.MISSION_STATE_NO_MISSION, 0

    def fly_foreign_mission(self, items: list[Message]) -> None:
        """Fly the mission of another ground station from its first item on."""
        self.store_foreign_mission(items)
        self.current = 0
        self.set_mode(PX4_MISSION if not self._is_copter else COPTER_AUTO)
        self._begin_if_flying()

    def begin_at(self, seq: int) -> None:
        """Make an item current, as another ground station would."""
        self._item_began_at = self._now
        self._set_current(seq)

    def stop_stream(self, name: str) -> None:
        """Send a message no more until it is asked for again."""
        self._streams.stop(name)

    def renumber(self, system: int) -> None:
        """Change its system id."""
        self.system = system
        self._wire = VehicleWire(system, 1)

    @property
    def _first_mode(self) -> int:
        """The mode after it was switched on."""
        return PX4_HOLD if self.script.autopilot == mavlink.MAV_AUTOPILOT_PX4 else 0

    def set_mode(self, custom_mode: int) -> None:
        """Change the mode as a pilot would."""
        self.in_failsafe = False
        if custom_mode == PX4_MISSION != self.custom_mode and self.script.repeats_pictures:
            self._resume_before_pictures()
        if self._is_copter and custom_mode == COPTER_AUTO != self.custom_mode:
            self._restart_mission()
        self.custom_mode = custom_mode
        self._mode_began_at = self._now
        self._target = None
        self._send_mode_change()

    def _resume_before_pictures(self) -> None:
        """Begin again at the place before the current item, as `mission_base.cpp` does."""
        before = list(enumerate(self.items[: self.current]))
        places = [seq for seq, item in before if item.frame != mavlink.MAV_FRAME_MISSION]
        shoots = any(item.command == mavlink.MAV_CMD_IMAGE_START_CAPTURE for _, item in before)
        if places and shoots:
            self.resumed_at.append(places[-1])
            self.current, self._item_began_at = places[-1], self._now

    def _restart_mission(self) -> None:
        """Begin at the first item when AUTO is entered, if MIS_RESTART is 1 (`AP_Mission.cpp`)."""
        if self.settings.get("MIS_RESTART") != 1.0:
            return
        first = int(self.script.home_is_item_0)
        if self.current > first:
            self.restarted_at.append(self.current)
        self.current, self._item_began_at = first, self._now

    def steer(self, custom_mode: int) -> None:
        """Fly manually in a mode from now on."""
        self.is_manual = True
        self.set_mode(custom_mode)
        self.heartbeat()

    def fail_safe(self, custom_mode: int) -> None:
        """Do what a failsafe of its own has chosen, until a mode is ordered."""
        self.in_failsafe = True
        self._target = None
        self.custom_mode = custom_mode
        self._mode_began_at = self._now
        self.heartbeat()

    def give_up(self) -> None:
        """Find in flight that a new fence forbids the mission: PX4 stays, and calls it finished."""
        self.mission_state = mavlink.MISSION_STATE_COMPLETE
        self.send_status_text("No valid mission available, loitering\t")

    def send(self, message: Message) -> None:
        """Send something that is not of its script."""
        self._send(message)

    def send_status_text(self, text: str, severity: int = mavlink.MAV_SEVERITY_CRITICAL) -> None:
        """Send a STATUSTEXT, if a ground station is present that is to receive it."""
        is_received = self._now - self._attended_at < STATION_S
        if is_received or not self.script.needs_station_for_texts:
            self._send(mavlink.MAVLink_statustext_message(severity, text.encode()))

    @property
    def in_mission(self) -> bool:
        """Whether the mode flies the mission."""
        return self.custom_mode == (
            PX4_MISSION if self.script.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA else 3
        )

    # Telemetry.

    def _send_mode_change(self) -> None:
        if self.script.heartbeats_at_once:
            self.heartbeat()

    def heartbeat(self) -> None:
        """Send a HEARTBEAT."""
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if self.in_mission:
            base |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED
        if self.armed:
            base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        if self.is_manual:
            base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        self._send(
            mavlink.MAVLink_heartbeat_message(
                self.script.vehicle_type,
                self.script.autopilot,
                base,
                self.custom_mode,
                mavlink.MAV_STATE_CRITICAL if self.in_failsafe else mavlink.MAV_STATE_ACTIVE,
                3,
            )
        )

    def _telemetry(self) -> None:
        makers = {
            "position": self._position,
            "attitude": self._attitude,
            "landed": self._landed,
            "health": self._health,
            "battery": self._battery,
            "mission": self._mission_current,
            "estimate": self._estimate,
        }
        for name in self._streams.due(self._now):
            is_sent = {"estimate": self._is_copter, "landed": self.script.sends_landed_state}
            if is_sent.get(name, True):
                self._send(makers[name]())

    @property
    def _is_copter(self) -> bool:
        return bool(self.script.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)

    def _estimate(self) -> Message:
        flags = mavlink.EKF_ATTITUDE | (mavlink.EKF_POS_HORIZ_ABS if self._navigates else 0)
        return mavlink.MAVLink_ekf_status_report_message(flags, 0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def _boot_ms(self) -> int:
        boot_ms = int((self._now - self.booted_at) * 1000)
        return boot_ms if self.clock_wraps_at_ms is None else boot_ms % self.clock_wraps_at_ms

    def _position(self) -> Message:
        height_mm = round(self.height_m * 1e3) if self.airborne else 0
        latitude, longitude = (round(degrees * 1e7) for degrees in self.place)
        amsl_mm = round(HOME[2] * 1000)
        return mavlink.MAVLink_global_position_int_message(
            self._boot_ms,
            latitude,
            longitude,
            amsl_mm + height_mm,
            height_mm,
            *(round(100.0 * speed_m_s) for speed_m_s in self.velocity_ned),
            0,
        )

    def _attitude(self) -> Message:
        return mavlink.MAVLink_attitude_message(self._boot_ms, 0.01, -0.02, self.yaw_rad, 0, 0, 0)

    def _landed(self) -> Message:
        landed = (
            mavlink.MAV_LANDED_STATE_IN_AIR if self.airborne else mavlink.MAV_LANDED_STATE_ON_GROUND
        )
        return mavlink.MAVLink_extended_sys_state_message(0, landed)

    def _health(self) -> Message:
        prearm = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        may = self._may_arm_here or not self.script.readiness_by_mode
        ready = prearm if self._ready and may and not self.script.checks_are_off else 0
        present = prearm if self.script.has_checks else 0
        return mavlink.MAVLink_sys_status_message(
            present | SENSORS,
            SENSORS if self.script.checks_are_off else present | SENSORS,
            (ready | SENSORS) & ~self.ill,
            *(0, 12000, 100, 80, 0, 0, 0, 0, 0, 0),
        )

    def _battery(self) -> Message:
        return mavlink.MAVLink_battery_status_message(
            0, 1, 1, 32767, [12000] + [65535] * 9, 100, 0, -1, 80
        )

    def _mission_current(self) -> Message:
        script = self.script
        count = len(self.items) if script.counts_home else max(0, len(self.items) - 1)
        state = self.mission_state
        if script.is_infeasible and self.items:
            state = mavlink.MISSION_STATE_NO_MISSION
        elif script.stops_elsewhere and not self.in_mission:
            is_active = state == mavlink.MISSION_STATE_ACTIVE
            state = mavlink.MISSION_STATE_NOT_STARTED if is_active else state
        total = count if self.items else script.no_mission_total
        current = mavlink.MAVLink_mission_current_message(
            self._shown_current(),
            total if script.sends_total else 0,
            state if script.sends_mission_state else mavlink.MISSION_STATE_UNKNOWN,
            1 if self.in_mission else 2,
        )
        return with_plan_ids(current, self.missions.plan_id, 0, 0)

    def _shown_current(self) -> int:
        if self._has_lost_current:
            return 0xFFFF
        if not self.script.shows_legs_only:
            return self.current
        legs = (i for i in range(self.current, len(self.items)) if self._is_leg(i))
        return next(legs, self.current) if self.current else 0

    def _is_leg(self, seq: int) -> bool:
        return bool(self.items[seq].command <= mavlink.MAV_CMD_NAV_LAST)

    # Commands and parameters.

    def _handle(self, message: Message) -> None:
        match message.get_type():
            case "COMMAND_LONG" | "COMMAND_INT":
                self._command(message)
            case "FOLLOW_TARGET":
                self.targets += 1
                self.last_target = message.lat / 1e7, message.lon / 1e7
            case "REQUEST_DATA_STREAM":
                self._streams.ask_group(message, self._now)
            case "TIMESYNC" if message.tc1 == 0 and self.script.has_timesync:
                self._send(mavlink.MAVLink_timesync_message(round(self._now * 1e9), message.ts1))
            case "PARAM_SET":
                self._set_parameter(message)
            case "PARAM_REQUEST_READ":
                self._parameter(message)
            case "MISSION_SET_CURRENT":
                self._set_current(message.seq)
            case "HEARTBEAT" if message.type == mavlink.MAV_TYPE_GCS:
                self._attended_at = self._now

    def _mission_stored(self) -> None:
        self.current = 0
        self._has_lost_current = self.script.loses_current
        self.mission_state = mavlink.MISSION_STATE_NOT_STARTED
        if self.script.is_infeasible:
            self.send_status_text("Mission rejected: takeoff altitude too low!\t")
            return
        self._begin_if_flying()  # In the mission mode it flies new items at once

    def _set_current(self, seq: int) -> None:
        self.current = seq
        self._has_lost_current = False
        self._send(self._mission_current())

    def _parameter(self, message: Message) -> None:
        """Send a parameter: a setting, the battery's size, the action on data link loss."""
        name = message.param_id
        value = self.settings.get(name)
        if name.startswith("BAT"):
            value = self.script.battery_capacity_mah
        elif name == "NAV_DLL_ACT" and self.script.link_loss_action is not None:
            self._send_integer(name, self.script.link_loss_action)
        if value is not None and name in WHOLE:
            self._send_integer(name, int(value))
        elif value is not None:
            kind = WHOLE_AS_FLOATS.get(name, mavlink.MAV_PARAM_TYPE_REAL32)
            self._send(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 0))

    def _send_integer(self, name: str, value: int) -> None:
        """Send a whole number as PX4 does, by its bits."""
        (bits,) = struct.unpack("<f", struct.pack("<i", value))
        kind = mavlink.MAV_PARAM_TYPE_INT32
        self._send(mavlink.MAVLink_param_value_message(name.encode(), bits, kind, 1, 0))

    def _set_parameter(self, message: Message) -> None:
        if message.param_id in self.settings:
            value = message.param_value
            if message.param_id in WHOLE:
                (value,) = struct.unpack("<i", struct.pack("<f", value))
            self.settings[message.param_id] = value
            self.written.append((message.param_id, value))
        self._parameter(message)

    def _command(self, message: Message) -> None:
        last = ("x", "y", "z") if message.get_type() == "COMMAND_INT" else PLACE
        names = (*(f"param{i}" for i in range(1, 5)), *last)
        values = tuple(getattr(message, name) for name in names)
        self.commands.append(message.command)
        arms = message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and message.param1 == 1.0
        self.arm_orders += arms
        self.parameters.append((message.command, values))
        if self.script.is_bare and self._is_for_payload(message):
            return
        result = self._judge(message)
        if result == mavlink.MAV_RESULT_ACCEPTED:
            self._obey(message)
        elif message.command not in {
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            mavlink.MAV_CMD_REQUEST_MESSAGE,
        }:
            self._complain()
        if message.command in self.lost_answers:
            return
        if self.script.accepts_modes_early and message.command == mavlink.MAV_CMD_DO_SET_MODE:
            accepted = mavlink.MAV_RESULT_ACCEPTED
            self._send(mavlink.MAVLink_command_ack_message(message.command, accepted))
        answer = mavlink.MAVLink_command_ack_message(message.command, result)
        if message.command in self.script.in_progress:
            working = mavlink.MAV_RESULT_IN_PROGRESS
            self._send(mavlink.MAVLink_command_ack_message(message.command, working))
            self._later.append((self._now + 2.0, answer))
        else:
            self._send(answer)

    def _is_for_payload(self, message: Message) -> bool:
        """Answer for a camera and a gimbal that are not there, as PX4 does.

        A command to another component has FAILED or is ignored; a gimbal's commands are left to a
        manager that does not run, so there is no answer.
        """
        if message.target_component not in {0, 1}:
            if not self.script.refuses_for_others:
                return True
            failed = mavlink.MAV_RESULT_FAILED
            self._send(mavlink.MAVLink_command_ack_message(message.command, failed))
            return True
        if message.command in CAMERA_COMMANDS:
            unknown = mavlink.MAV_RESULT_UNSUPPORTED
            self._send(mavlink.MAVLink_command_ack_message(message.command, unknown))
        return message.command in CAMERA_COMMANDS | GIMBAL_COMMANDS

    def _judge(self, message: Message) -> int:
        """MAV_RESULT of a command, before it is obeyed."""
        script = self.script
        if script.manages_gimbal and message.command in GIMBAL_COMMANDS:
            sender = Sender(message.get_srcSystem(), message.get_srcComponent())
            return self.gimbal.order(message.command, self.parameters[-1][1], sender)
        refusals: dict[int, Callable[[], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: lambda: self._judge_arming(message),
            mavlink.MAV_CMD_MISSION_START: self._judge_start,
            mavlink.MAV_CMD_DO_SET_MODE: lambda: self._judge_mode(
                int(message.param2), int(message.param3)
            ),
            mavlink.MAV_CMD_DO_PAUSE_CONTINUE: self._judge_pause,
        }
        result: int = script.results.get(message.command, mavlink.MAV_RESULT_ACCEPTED)
        if result == mavlink.MAV_RESULT_ACCEPTED and message.command in refusals:
            return refusals[message.command]()
        unknown = {
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: not script.knows_intervals,
            mavlink.MAV_CMD_REQUEST_MESSAGE: (
                message.param1 == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT
                and not script.sends_current_on_request
            ),
        }
        is_unknown = unknown.get(message.command, False)
        return int(mavlink.MAV_RESULT_UNSUPPORTED) if is_unknown else result

    @property
    def _may_arm_here(self) -> bool:
        arms_in = self.script.arms_in
        if self.script.readiness_by_mode and self.in_mission and not self.items:
            return False
        return arms_in is None or self.custom_mode in arms_in

    def _judge_arming(self, message: Message) -> int:
        """Arming needs readiness; disarming in the air needs the number that forces it."""
        if message.param1 == 0.0:
            denied = self.airborne and message.param2 != FORCED
            is_px4 = self.script.autopilot == mavlink.MAV_AUTOPILOT_PX4
            refusal = (
                mavlink.MAV_RESULT_TEMPORARILY_REJECTED if is_px4 else mavlink.MAV_RESULT_FAILED
            )
            return int(refusal if denied else mavlink.MAV_RESULT_ACCEPTED)
        if self._ready and self._may_arm_here:
            return int(mavlink.MAV_RESULT_ACCEPTED)
        if self.script.arming_complaint:
            self.send_status_text(self.script.arming_complaint)
        return self.script.arming_refusal

    def _judge_pause(self) -> int:
        """ArduPilot pauses within AUTO and GUIDED only, and does not leave them."""
        pauses = not self._is_copter or self.custom_mode in {COPTER_AUTO, COPTER_GUIDED}
        return int(mavlink.MAV_RESULT_ACCEPTED if pauses else mavlink.MAV_RESULT_FAILED)

    def _judge_start(self) -> int:
        if self.script.is_infeasible:
            self.send_status_text("Mission start denied! No valid mission\t")
            return int(mavlink.MAV_RESULT_DENIED)
        return self._judge_mode(COPTER_AUTO)

    def _judge_mode(self, main: int, sub: int = 0) -> int:
        """ArduPilot's AUTO begins on the ground with a take-off only."""
        flies_items = main == COPTER_AUTO if self._is_copter else (main, sub) == (4, 4)
        if flies_items and not self.items and not self.script.flies_without_items:
            denied = mavlink.MAV_RESULT_FAILED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
            return int(denied[not self._is_copter])
        if self.script.is_infeasible and self.armed and main == COPTER_GUIDED:
            return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)  # PX4's AUTO has the same number
        first = self.script.home_is_item_0
        legs = [item for item in self.items[first:] if item.command <= mavlink.MAV_CMD_NAV_LAST]
        takes_off = bool(legs) and legs[0].command == mavlink.MAV_CMD_NAV_TAKEOFF
        standing = self.armed and not self.airborne
        auto = self.script.wants_takeoff_first and main == COPTER_AUTO
        if self._is_copter and not self._navigates:
            self.send_status_text(
                "Mode change failed: requires position", mavlink.MAV_SEVERITY_WARNING
            )
            return int(mavlink.MAV_RESULT_FAILED)
        if auto and standing and not takes_off:
            self.send_status_text("Auto: Missing Takeoff Cmd")
            return int(mavlink.MAV_RESULT_FAILED)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _answer_later(self, now: float) -> None:
        due = [message for at, message in self._later if now >= at]
        self._later = [(at, message) for at, message in self._later if now < at]
        for message in due:
            self._send(message)

    @property
    def _ready(self) -> bool:
        return self._now - self.booted_at >= self.script.ready_to_arm_after_s and self._attended

    @property
    def _navigates(self) -> bool:
        return self._now - self.booted_at >= self.script.navigates_after_s

    @property
    def _attended(self) -> bool:
        """Whether it has a ground station, or wants none."""
        patience_s = self.settings.get("COM_DL_LOSS_T", 10.0)
        return not self.script.link_loss_action or self._now - self._attended_at < patience_s

    def _obey(self, message: Message) -> None:
        match message.command:
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.armed = message.param1 == 1.0
                self._disarm_at = self._now + self.script.disarms_unstarted_s
                self._send_mode_change()
            case mavlink.MAV_CMD_DO_SET_MODE:
                main, sub = int(message.param2), int(message.param3)
                is_px4 = self.script.autopilot == mavlink.MAV_AUTOPILOT_PX4
                self.set_mode(main << 16 | sub << 24 if is_px4 else main)
                self._begin_if_flying()
            case mavlink.MAV_CMD_MISSION_START if not self.script.ignores_start:
                is_copter = self.script.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
                self._target = None
                if is_copter and not self.in_mission:
                    self._restart_mission()
                self.custom_mode = COPTER_AUTO if is_copter else PX4_MISSION
                self._begin_if_flying()
                self._send_mode_change()
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE if not self._is_copter:
                self._target = None
                self.custom_mode = PX4_HOLD if message.param1 == 0.0 else PX4_MISSION
                self._send_mode_change()
            case mavlink.MAV_CMD_RUN_PREARM_CHECKS if not self._ready and self.script.fault:
                self.send_status_text(self.script.fault)
            case mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
                self._select(int(message.param1), resets=message.param2 == 1.0)
            case mavlink.MAV_CMD_REQUEST_MESSAGE:
                self._requested(int(message.param1))
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL if not self.ignores_intervals:
                self._streams.ask(int(message.param1), message.param2, self._now)
            case _:
                self._fly_live(message)

    def _fly_live(self, message: Message) -> None:
        match message.command:
            case mavlink.MAV_CMD_NAV_LAND if self.script.autopilot == mavlink.MAV_AUTOPILOT_PX4:
                self.set_mode(PX4_LAND)
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                is_px4 = self.script.autopilot == mavlink.MAV_AUTOPILOT_PX4
                self.set_mode(PX4_RETURN if is_px4 else COPTER_RETURN)
            case mavlink.MAV_CMD_DO_REPOSITION if self._leads_out(message):
                self.send_status_text("Reposition is outside geofence\t")
                self.set_mode(PX4_HOLD)
            case mavlink.MAV_CMD_DO_REPOSITION:
                if not math.isnan(message.param4):
                    self.yaw_rad = message.param4
                copter = self.script.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
                self.set_mode(COPTER_GUIDED if copter else PX4_HOLD)
                has_speed = math.isfinite(message.param1) and message.param1 > 0.0
                self._target = Target(
                    message.x / 1e7,
                    message.y / 1e7,
                    message.z - HOME[2],
                    message.param1 if has_speed else self.script.speed_m_s,
                )
            case mavlink.MAV_CMD_CONDITION_YAW:
                self.yaw_rad = math.remainder(math.radians(message.param1), 2.0 * math.pi)
            case mavlink.MAV_CMD_DO_ORBIT:
                centre = message.x / 1e7, message.y / 1e7
                angle = math.inf if math.isnan(message.param4) else message.param4
                self.circle = Circle(centre, message.param1, message.param2, angle)
                self.set_mode(PX4_ORBIT)
            case mavlink.MAV_CMD_DO_FOLLOW:
                self.set_mode(PX4_FOLLOW)

    def _leads_out(self, message: Message) -> bool:
        offset_m = LocalGround(*HOME[:2]).north_east_m(message.x / 1e7, message.y / 1e7)
        return math.hypot(*offset_m) > self.script.fence_m

    def _requested(self, message_id: int) -> None:
        if message_id == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
            self._send(self._mission_current())
        elif message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self._send(self._autopilot_version())
        elif message_id == mavlink.MAVLINK_MSG_ID_HOME_POSITION and self.script.has_home:
            self._send(
                mavlink.MAVLink_home_position_message(
                    round(self.home[0] * 1e7),
                    round(self.home[1] * 1e7),
                    round(self.home[2] * 1e3),
                    *(0.0, 0.0, 0.0),
                    [1.0, 0.0, 0.0, 0.0],
                    *(0.0, 0.0, 0.0),
                )
            )

    def _autopilot_version(self) -> Message:
        nothing = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(
            0, self.script.version, 0, 0, 0, nothing, nothing, nothing, *self.script.product, 0
        )

    def _complain(self) -> None:
        if self.script.complaint:
            self.send_status_text(self.script.complaint)

    # Flying.

    def _begin_if_flying(self) -> None:
        if self.armed and self.in_mission and self.items:
            self.airborne = True
            self._disarm_at = math.inf
            self.mission_state = mavlink.MISSION_STATE_ACTIVE
            self._item_began_at = self._now

    def _select(self, seq: int, *, resets: bool) -> None:
        """Set the current item; a reset may begin all up to the first leg, in whatever mode."""
        if resets and self.script.reset_resumes:
            self.mission_state = mavlink.MISSION_STATE_ACTIVE
            kinds = [] if self.in_mission else [item.command for item in self.items[seq:]]
            legs = [n for n, kind in enumerate(kinds) if kind <= mavlink.MAV_CMD_NAV_LAST]
            self.begun_early += kinds[: legs[0] + 1 if legs else None]
        self._set_current(seq)

    def _come_down(self) -> None:
        """Land, as the modes that do so end."""
        is_px4 = self.script.autopilot == mavlink.MAV_AUTOPILOT_PX4
        landing = {PX4_LAND, PX4_RETURN} if is_px4 else {COPTER_LAND, COPTER_RETURN}
        ended = self._now - self._mode_began_at >= LANDING_S
        if self.armed and self.airborne and self.custom_mode in landing and ended:
            self._land()

    def _land(self) -> None:
        self.airborne = False
        self._disarm_at = self._now + self.script.disarms_after_s
        if self.script.disarms_after_s == 0.0:
            self._disarm()

    def _disarm(self) -> None:
        self._disarm_at = math.inf
        self.armed = False
        if self.script.begins_anew_when_disarmed and self.in_mission:
            self._begin_anew()
        self._send_mode_change()

    def _begin_anew(self) -> None:
        """Forget how far it was; the mission runs on, and a take-off waits for the propellers."""
        if self.mission_state == mavlink.MISSION_STATE_ACTIVE:
            self.current = int(self.script.home_is_item_0)

    def _reposition(self, elapsed_s: float) -> None:
        """Fly straight to where a DO_REPOSITION sent it, at most at its ground speed."""
        self.velocity_ned = (0.0, 0.0, 0.0)
        target = self._target
        if target is None or not self.airborne or not self.script.goes_to_places or not elapsed_s:
            return
        ground = LocalGround(*self.place)
        north_m, east_m = ground.north_east_m(target.latitude_deg, target.longitude_deg)
        left_m, climb_m = math.hypot(north_m, east_m), target.relative_altitude_m - self.height_m
        flown_m = min(left_m, target.ground_speed_m_s * elapsed_s)
        climbed_m = math.copysign(
            min(abs(climb_m), self.script.climb_rate_m_s * elapsed_s), climb_m
        )
        share = flown_m / left_m if left_m else 0.0
        self.place = ground.place(share * north_m, share * east_m)
        self.height_m += climbed_m
        self.velocity_ned = (
            share * north_m / elapsed_s,
            share * east_m / elapsed_s,
            -climbed_m / elapsed_s,
        )

    def _go_round(self) -> None:
        """Fly on along the circle, and hold when it has been flown as far as was asked for."""
        if self.circle is None or self.custom_mode != PX4_ORBIT:
            return
        if self._now < self._mode_began_at + self.script.circle_after_s:
            self.place = self.circle.centre
            return
        self.place = self.circle.after(TELEMETRY_S)
        if self.circle.is_complete:
            self.circle = None
            self.set_mode(PX4_HOLD)

    def _fly(self) -> None:
        active = self.mission_state == mavlink.MISSION_STATE_ACTIVE
        if not (self.armed and active and self.in_mission and self.items):
            self.gimbal.leave_mission()
            return
        item = self.items[self.current]
        if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
            return
        quick = item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED
        if not quick and self._now - self._item_began_at < self.script.item_time_s:
            return
        self._item_began_at = self._now
        self._reached(item)

    def _reached(self, item: Message) -> None:
        lands = item.command in {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH}
        if lands and self.script.begins_anew_when_disarmed:
            self._land_as_copter(item)
            return
        if self.script.sends_item_reached:
            self._send(mavlink.MAVLink_mission_item_reached_message(self.current))
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH and self.script.return_changes_mode:
            self.set_mode(PX4_RETURN)
        elif item.command in {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH}:
            self._land()
        if self.script.manages_gimbal:
            first = tuple(getattr(item, f"param{i}") for i in range(1, 5))
            self.gimbal.order(item.command, (*first, item.x))
        if self.current + 1 < len(self.items):
            self.current += 1
        else:
            self.mission_state = mavlink.MISSION_STATE_COMPLETE
            if self.script.current_goes_to_0_at_the_end:
                self.current = 0
        self._send(self._mission_current())

    def _land_as_copter(self, item: Message) -> None:
        """End a mission by a return; in a landing it is disarmed, and has not reached that."""
        if not self.airborne:
            return
        self._land()
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self._send(mavlink.MAVLink_mission_item_reached_message(self.current))
            self.mission_state, self.current = mavlink.MISSION_STATE_COMPLETE, 0

    def _send(self, message: Message) -> None:
        self._outbox.append(self._wire.encode(message))
