"""A vehicle that behaves on the link as its script sets: PX4-like or ArduPilot-like.

Every item takes a fixed time; a landing ends on the ground and disarmed. It receives and sends
frames only, in simulated time.
"""

import math

from tests.support import scripted_judgement as judgement
from tests.support import scripted_telemetry as telemetry
from tests.support.geodesy import LocalGround
from tests.support.px4_gimbal import Px4Gimbal
from tests.support.scripted_missions import ScriptedMissions
from tests.support.scripted_motion import Circle, Movement, Target
from tests.support.scripted_parameters import ScriptedParameters
from tests.support.scripted_progress import ScriptedProgress
from tests.support.scripted_streams import TELEMETRY_S, ScriptedStreams
from tests.support.vehicle_script import (
    COPTER_AUTO,
    COPTER_GUIDED,
    COPTER_LAND,
    COPTER_RETURN,
    HOME,
    PX4,
    PX4_FOLLOW,
    PX4_HOLD,
    PX4_LAND,
    PX4_MISSION,
    PX4_ORBIT,
    PX4_RETURN,
    Script,
)
from tests.support.vehicle_wire import Message, VehicleWire, mavlink

PLACE = ("param5", "param6", "param7")
STATION_S = 5.0
"""Time for which a ground station counts as present after its heartbeat."""


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
        self.custom_mode = self._first_mode
        self.progress = ScriptedProgress(self.missions)
        self.begun_early = self.progress.begun_early
        self.resumed_at = self.progress.resumed_at
        self.restarted_at = self.progress.restarted_at
        self.commands: list[int] = []
        self.arm_orders = 0
        """How often it was ordered to arm, disarming left out."""
        self.parameters: list[tuple[int, tuple[float, ...]]] = []
        self.silent = False
        self.gimbal = Px4Gimbal(system)
        self.lost_answers: set[int] = set()  # Commands that are obeyed, their answers lost
        self.ignores_intervals = False
        self._parameters = ScriptedParameters(script, self._send)
        self.settings = self._parameters.settings
        self.written = self._parameters.written  # Parameters, as they were set
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
    def current(self) -> int:
        """The item of the mission that is flown."""
        return self.progress.current

    @current.setter
    def current(self, seq: int) -> None:
        self.progress.current = seq

    @property
    def mission_state(self) -> int:
        """MISSION_STATE."""
        return int(self.progress.state)

    @mission_state.setter
    def mission_state(self, state: int) -> None:
        self.progress.state = state

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
        self.set_mode(self.script.mission_mode)
        self._begin_if_flying()

    def begin_at(self, seq: int) -> None:
        """Make an item current, as another ground station would."""
        self.progress.began_at = self._now
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
        return PX4_HOLD if self.script.is_px4 else 0

    def set_mode(self, custom_mode: int) -> None:
        """Change the mode as a pilot would."""
        self.in_failsafe = False
        if custom_mode == PX4_MISSION != self.custom_mode and self.script.repeats_pictures:
            self.progress.resume_before_pictures(self._now)
        if self.script.is_copter and custom_mode == COPTER_AUTO != self.custom_mode:
            self._restart_mission()
        self.custom_mode = custom_mode
        self._mode_began_at = self._now
        self._target = None
        self._send_mode_change()

    def _restart_mission(self) -> None:
        """Begin at the first item when AUTO is entered, if MIS_RESTART is 1 (`AP_Mission.cpp`)."""
        if self.settings.get("MIS_RESTART") == 1.0:
            self.progress.restart(self._now)

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
        return self.custom_mode == self.script.mission_mode

    # Telemetry.

    def _send_mode_change(self) -> None:
        if self.script.heartbeats_at_once:
            self.heartbeat()

    def heartbeat(self) -> None:
        """Send a HEARTBEAT."""
        self._send(telemetry.heartbeat(self))

    def _telemetry(self) -> None:
        for name in self._streams.due(self._now):
            is_sent = {"estimate": self.script.is_copter, "landed": self.script.sends_landed_state}
            if name == "mission":
                self._send(self._mission_current())
            elif is_sent.get(name, True):
                self._send(telemetry.STREAMS[name](self))

    @property
    def boot_ms(self) -> int:
        boot_ms = int((self._now - self.booted_at) * 1000)
        return boot_ms if self.clock_wraps_at_ms is None else boot_ms % self.clock_wraps_at_ms

    def _mission_current(self) -> Message:
        return self.progress.message(in_mission=self.in_mission)

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
                self._parameters.set(message.param_id, message.param_value)
                self._parameter(message)
            case "PARAM_REQUEST_READ":
                self._parameter(message)
            case "MISSION_SET_CURRENT":
                self._set_current(message.seq)
            case "HEARTBEAT" if message.type == mavlink.MAV_TYPE_GCS:
                self._attended_at = self._now

    def _mission_stored(self) -> None:
        self.progress.stored()
        if self.script.is_infeasible:
            self.send_status_text("Mission rejected: takeoff altitude too low!\t")
            return
        self._begin_if_flying()  # In the mission mode it flies new items at once

    def _set_current(self, seq: int) -> None:
        self.progress.set_current(seq)
        self._send(self._mission_current())

    def _select(self, seq: int, *, resets: bool) -> None:
        if resets:
            self.progress.reset_to(seq, in_mission=self.in_mission)
        self._set_current(seq)

    def _parameter(self, message: Message) -> None:
        self._parameters.read(message.param_id, self.script)

    def _command(self, message: Message) -> None:
        last = ("x", "y", "z") if message.get_type() == "COMMAND_INT" else PLACE
        names = (*(f"param{i}" for i in range(1, 5)), *last)
        values = tuple(getattr(message, name) for name in names)
        self.commands.append(message.command)
        arms = message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and message.param1 == 1.0
        self.arm_orders += arms
        self.parameters.append((message.command, values))
        if self.script.is_bare and judgement.is_for_payload(self, message):
            return
        result = judgement.judge(self, message)
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

    def _answer_later(self, now: float) -> None:
        due = [message for at, message in self._later if now >= at]
        self._later = [(at, message) for at, message in self._later if now < at]
        for message in due:
            self._send(message)

    @property
    def is_ready(self) -> bool:
        return self._now - self.booted_at >= self.script.ready_to_arm_after_s and self._attended

    @property
    def navigates(self) -> bool:
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
                is_px4 = self.script.is_px4
                self.set_mode(main << 16 | sub << 24 if is_px4 else main)
                self._begin_if_flying()
            case mavlink.MAV_CMD_MISSION_START if not self.script.ignores_start:
                is_copter = self.script.is_copter
                self._target = None
                if is_copter and not self.in_mission:
                    self._restart_mission()
                self.custom_mode = self.script.mission_mode
                self._begin_if_flying()
                self._send_mode_change()
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE if not self.script.is_copter:
                self._target = None
                self.custom_mode = PX4_HOLD if message.param1 == 0.0 else PX4_MISSION
                self._send_mode_change()
            case mavlink.MAV_CMD_RUN_PREARM_CHECKS if not self.is_ready and self.script.fault:
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
            case mavlink.MAV_CMD_NAV_LAND if self.script.is_px4:
                self.set_mode(PX4_LAND)
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                is_px4 = self.script.is_px4
                self.set_mode(PX4_RETURN if is_px4 else COPTER_RETURN)
            case mavlink.MAV_CMD_DO_REPOSITION if self._leads_out(message):
                self.send_status_text("Reposition is outside geofence\t")
                self.set_mode(PX4_HOLD)
            case mavlink.MAV_CMD_DO_REPOSITION:
                if not math.isnan(message.param4):
                    self.yaw_rad = message.param4
                copter = self.script.is_copter
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
            self._send(telemetry.home_position(self))

    def _autopilot_version(self) -> Message:
        return telemetry.autopilot_version(self)

    def _complain(self) -> None:
        if self.script.complaint:
            self.send_status_text(self.script.complaint)

    # Flying.

    def _begin_if_flying(self) -> None:
        if self.armed and self.in_mission and self.items:
            self.airborne = True
            self._disarm_at = math.inf
            self.progress.begin(self._now)

    def _come_down(self) -> None:
        """Land, as the modes that do so end."""
        is_px4 = self.script.is_px4
        landing = {PX4_LAND, PX4_RETURN} if is_px4 else {COPTER_LAND, COPTER_RETURN}
        ended = self._now - self._mode_began_at >= self.script.landing_s
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
            self.progress.begin_anew()
        self._send_mode_change()

    def _reposition(self, elapsed_s: float) -> None:
        """Fly straight to where a DO_REPOSITION sent it, at most at its ground speed."""
        before = Movement(self.place, self.height_m)
        goes = self.airborne and self.script.goes_to_places and elapsed_s > 0.0
        if self._target is not None and goes:
            now = self._target.approach(before, elapsed_s, self.script.climb_rate_m_s)
        else:
            now = before
        self.place, self.height_m, self.velocity_ned = now

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
        active = self.progress.is_active
        if not (self.armed and active and self.in_mission and self.items):
            self.gimbal.leave_mission()
            return
        item = self.items[self.current]
        if self.progress.is_over(item, self._now):
            self.progress.began_at = self._now
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
        self.progress.advance()
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
