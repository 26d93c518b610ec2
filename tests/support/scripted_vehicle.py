"""A vehicle that behaves on the wire as its script says: PX4-like or ArduPilot-like.

It flies by the clock: every item takes a while, a landing ends on the ground and disarmed. It
knows nothing of the broker but its frames. Time is simulated; bytes in, bytes out.

What the scripts follow: PX4's `mavlink_mission.cpp` (atomic store, an id over the items, a
repeated last item acknowledged again, MISSION_ERROR when busy) and ArduPilot's
`MissionItemProtocol.cpp` (item 0 is home, float requests, items written one by one, no ids).
"""

import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mavlink_broker.dialect import (
    Decoder,
    Encoder,
    Message,
    MissionAck,
    MissionCount,
    MissionCurrent,
    mavlink,
)

HOME = (40.44340, -3.73820, 650.0)
PX4_HOLD = 4 << 16 | 3 << 24
PX4_MISSION = 4 << 16 | 4 << 24
PX4_RETURN = 4 << 16 | 5 << 24
PX4_POSITION = 3 << 16
COPTER_GUIDED = 4
COPTER_AUTO = 3

_REPEAT_REQUEST_S = 0.25
_IDLE_TRANSFER_S = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Script:
    """How this vehicle differs from a well-behaved one."""

    autopilot: int = mavlink.MAV_AUTOPILOT_PX4
    vehicle_type: int = mavlink.MAV_TYPE_QUADROTOR
    gives_ids: bool = True
    home_is_item_0: bool = False
    float_requests: bool = False
    forgets_parameters: bool = False  # Keeps of a waypoint nothing but its hold time
    lost_acknowledgements: int = 0  # The first so many final MISSION_ACK are not sent
    busy_for_s: float = 0.0  # Answers MISSION_COUNT with MISSION_ERROR
    refused_item: int | None = None  # Answered by INVALID_PARAM3
    corrupts_item: int | None = None  # Stored at another altitude
    results: Mapping[int, int] = field(default_factory=dict)  # MAV_RESULT per command
    ready_to_arm_after_s: float = 0.0
    complaint: str = ""  # STATUSTEXT that goes with a refusal
    item_time_s: float = 2.0
    tells_reached: bool = True
    has_home: bool = True
    battery_capacity_mah: float | None = 4200.0
    ignores_start: bool = False


PX4 = Script()
ARDUPILOT = Script(
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    gives_ids=False,
    home_is_item_0=True,
    float_requests=True,
    forgets_parameters=True,
)


class ScriptedVehicle:
    """One vehicle."""

    def __init__(self, system: int, script: Script = PX4, *, booted_at: float = 0.0) -> None:
        self.system = system
        self.script = script
        self.armed = False
        self.airborne = False
        self.custom_mode = PX4_HOLD if script.autopilot == mavlink.MAV_AUTOPILOT_PX4 else 0
        self.items: list[Message] = []
        self.current = 0
        self.mission_state = mavlink.MISSION_STATE_NO_MISSION
        self.uploads = 0
        self.commands: list[int] = []
        self.parameters: list[tuple[int, tuple[float, ...]]] = []
        self.silent = False
        self.home = HOME
        self._booted_at = booted_at
        self._now = booted_at
        self._decoder = Decoder()
        self._encoder = Encoder(system, 1)
        self._outbox: list[bytes] = []
        self._transfer: dict[int, Message] = {}
        self._transfer_count = 0
        self._asked_at = 0.0
        self._progress_at = 0.0
        self._acknowledged: Message | None = None
        self._lost_acknowledgements = script.lost_acknowledgements
        self._item_began_at = 0.0
        self._next = {"heartbeat": booted_at, "telemetry": booted_at}

    # The world's side.

    def receive(self, datagram: bytes, now: float) -> None:
        """Take what the broker sent."""
        self._now = now
        for message in self._decoder.decode(datagram):
            if getattr(message, "target_system", self.system) in {0, self.system}:
                self._handle(message)

    def step(self, now: float) -> list[bytes]:
        """Let time pass; gives the frames to send."""
        self._now = now
        self._fly()
        self._ask_again()
        if now >= self._next["heartbeat"]:
            self._next["heartbeat"] = now + 1.0
            self.heartbeat()
        if now >= self._next["telemetry"]:
            self._next["telemetry"] = now + 0.2
            self._telemetry()
        frames, self._outbox = self._outbox, []
        return [] if self.silent else frames

    def reboot(self, now: float) -> None:
        """Start anew on the ground; the stored mission survives, the clock does not."""
        self.armed = self.airborne = False
        self._booted_at = now
        self._next = {"heartbeat": now, "telemetry": now}
        self._transfer_count = 0
        self.mission_state = mavlink.MISSION_STATE_NOT_STARTED
        self.current = 0

    def set_mode(self, custom_mode: int) -> None:
        """Change the mode as a pilot would."""
        self.custom_mode = custom_mode
        self.heartbeat()

    def say(self, text: str, severity: int = mavlink.MAV_SEVERITY_CRITICAL) -> None:
        """Send a STATUSTEXT."""
        self._send(mavlink.MAVLink_statustext_message(severity, text.encode()))

    @property
    def in_mission(self) -> bool:
        """Whether the mode flies the mission."""
        return self.custom_mode == (
            PX4_MISSION if self.script.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA else 3
        )

    # Telemetry.

    def heartbeat(self) -> None:
        """Send a HEARTBEAT."""
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if self.in_mission:
            base |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED
        if self.armed:
            base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        self._send(
            mavlink.MAVLink_heartbeat_message(
                self.script.vehicle_type, self.script.autopilot, base, self.custom_mode, 4, 3
            )
        )

    def _telemetry(self) -> None:
        boot_ms = int((self._now - self._booted_at) * 1000)
        height_mm = 5000 if self.airborne else 0
        latitude, longitude = round(HOME[0] * 1e7), round(HOME[1] * 1e7)
        amsl_mm = round(HOME[2] * 1000)
        ready = self._now - self._booted_at >= self.script.ready_to_arm_after_s
        prearm = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        landed = (
            mavlink.MAV_LANDED_STATE_IN_AIR if self.airborne else mavlink.MAV_LANDED_STATE_ON_GROUND
        )
        messages = [
            mavlink.MAVLink_global_position_int_message(
                boot_ms, latitude, longitude, amsl_mm + height_mm, height_mm, 100, 0, 0, 0
            ),
            mavlink.MAVLink_attitude_message(boot_ms, 0.01, -0.02, -math.pi / 2, 0, 0, 0),
            mavlink.MAVLink_extended_sys_state_message(0, landed),
            mavlink.MAVLink_sys_status_message(
                prearm, prearm, prearm if ready else 0, 0, 12000, 100, 80, 0, 0, 0, 0, 0, 0
            ),
            mavlink.MAVLink_battery_status_message(
                0, 1, 1, 32767, [12000] + [65535] * 9, 100, 0, -1, 80
            ),
            self._mission_current(),
        ]
        for message in messages:
            self._send(message)

    def _mission_current(self) -> Message:
        return MissionCurrent(
            self.current,
            len(self.items),
            self.mission_state,
            1 if self.in_mission else 2,
            self._plan_id(),
        )

    def _plan_id(self) -> int:
        if not self.script.gives_ids or not self.items:
            return 0
        text = repr([_fields(item) for item in self.items])
        return zlib.crc32(text.encode()) or 1

    # The mission protocol.

    def _handle(self, message: Message) -> None:
        handlers: Mapping[str, Callable[[Message], None]] = {
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_REQUEST_LIST": self._list,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_SET_CURRENT": lambda m: self._set_current(m.seq),
            "COMMAND_LONG": self._command,
            "PARAM_REQUEST_READ": self._parameter,
        }
        handler = handlers.get(message.get_type())
        if handler is not None:
            handler(message)

    def _count(self, message: Message) -> None:
        if self._now - self._booted_at < self.script.busy_for_s:
            self._acknowledge(mavlink.MAV_MISSION_ERROR)
            return
        self._transfer = {}
        self._transfer_count = message.count
        self._acknowledged = None
        self._progress_at = self._now
        self._ask()

    def _item(self, message: Message) -> None:
        if self._transfer_count == 0:
            if self._acknowledged is not None and message.seq == len(self.items) - 1:
                self._final(self._acknowledged)
            return
        if message.seq != len(self._transfer):
            self._ask()
            return
        if message.seq == self.script.refused_item:
            self._transfer_count = 0
            self._complain()
            self._acknowledge(mavlink.MAV_MISSION_INVALID_PARAM3)
            return
        self._transfer[message.seq] = self._stored(message)
        self._progress_at = self._now
        if len(self._transfer) < self._transfer_count:
            self._ask()
        else:
            self._complete()

    def _stored(self, message: Message) -> Message:
        if message.seq == self.script.corrupts_item:
            message.z += 5.0
        if self.script.forgets_parameters and message.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            message.param2 = message.param3 = message.param4 = 0.0
        return message

    def _complete(self) -> None:
        self.items = [self._transfer[seq] for seq in sorted(self._transfer)]
        self._transfer_count = 0
        self.uploads += 1
        self.current = 0
        self.mission_state = mavlink.MISSION_STATE_NOT_STARTED
        self._begin_if_flying()  # Whoever is in the mission mode flies what it is given
        self._acknowledged = MissionAck(0, 0, mavlink.MAV_MISSION_ACCEPTED, 0, self._plan_id())
        self._final(self._acknowledged)

    def _final(self, acknowledgement: Message) -> None:
        if self._lost_acknowledgements > 0:
            self._lost_acknowledgements -= 1
            return
        self._send(acknowledgement)

    def _ask(self) -> None:
        self._asked_at = self._now
        kind = (
            mavlink.MAVLink_mission_request_message
            if self.script.float_requests
            else mavlink.MAVLink_mission_request_int_message
        )
        self._send(kind(0, 0, len(self._transfer)))

    def _ask_again(self) -> None:
        if self._transfer_count == 0:
            return
        if self._now - self._progress_at > _IDLE_TRANSFER_S:
            self._transfer_count = 0
        elif self._now - self._asked_at >= _REPEAT_REQUEST_S:
            self._ask()

    def _list(self, message: Message) -> None:
        del message
        self._send(MissionCount(0, 0, len(self.items), 0, self._plan_id()))

    def _request(self, message: Message) -> None:
        if message.seq < len(self.items):
            item = self.items[message.seq]
            item.target_system = item.target_component = 0
            self._send(item)
        else:
            self._acknowledge(mavlink.MAV_MISSION_INVALID_SEQUENCE)

    def _acknowledge(self, result: int) -> None:
        self._send(MissionAck(0, 0, result))

    def _set_current(self, seq: int) -> None:
        self.current = seq
        self._send(self._mission_current())

    def _parameter(self, message: Message) -> None:
        if self.script.battery_capacity_mah is not None:
            self._send(
                mavlink.MAVLink_param_value_message(
                    message.param_id.encode(),
                    self.script.battery_capacity_mah,
                    mavlink.MAV_PARAM_TYPE_REAL32,
                    1,
                    0,
                )
            )

    # Commands.

    def _command(self, message: Message) -> None:
        values = tuple(getattr(message, f"param{i}") for i in range(1, 8))
        self.commands.append(message.command)
        self.parameters.append((message.command, values))
        result = self.script.results.get(message.command, mavlink.MAV_RESULT_ACCEPTED)
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and not self._ready:
            result = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        if result == mavlink.MAV_RESULT_ACCEPTED:
            self._obey(message)
        elif message.command != mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
            self._complain()
        self._send(mavlink.MAVLink_command_ack_message(message.command, result))

    @property
    def _ready(self) -> bool:
        return self._now - self._booted_at >= self.script.ready_to_arm_after_s

    def _obey(self, message: Message) -> None:
        match message.command:
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.armed = message.param1 == 1.0
                self.heartbeat()
            case mavlink.MAV_CMD_DO_SET_MODE:
                main, sub = int(message.param2), int(message.param3)
                is_px4 = self.script.autopilot == mavlink.MAV_AUTOPILOT_PX4
                self.custom_mode = main << 16 | sub << 24 if is_px4 else main
                self._begin_if_flying()
                self.heartbeat()
            case mavlink.MAV_CMD_MISSION_START if not self.script.ignores_start:
                is_copter = self.script.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
                self.custom_mode = COPTER_AUTO if is_copter else PX4_MISSION
                self._begin_if_flying()
                self.heartbeat()
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE if message.param1 == 0.0:
                self.custom_mode = PX4_HOLD
                self.heartbeat()
            case mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
                self._set_current(int(message.param1))
            case mavlink.MAV_CMD_REQUEST_MESSAGE:
                self._requested(int(message.param1))

    def _requested(self, message_id: int) -> None:
        if message_id == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
            self._send(self._mission_current())
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

    def _complain(self) -> None:
        if self.script.complaint:
            self.say(self.script.complaint)

    # Flying.

    def _begin_if_flying(self) -> None:
        if self.armed and self.in_mission and self.items:
            self.airborne = True
            self.mission_state = mavlink.MISSION_STATE_ACTIVE
            self._item_began_at = self._now

    def _fly(self) -> None:
        active = self.mission_state == mavlink.MISSION_STATE_ACTIVE
        if not (self.armed and active and self.in_mission and self.items):
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
        if self.script.tells_reached:
            self._send(mavlink.MAVLink_mission_item_reached_message(self.current))
        if item.command in {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH}:
            self.armed = self.airborne = False
            self.heartbeat()
        if self.current + 1 < len(self.items):
            self.current += 1
        else:
            self.mission_state = mavlink.MISSION_STATE_COMPLETE
        self._send(self._mission_current())

    def _send(self, message: Message) -> None:
        self._outbox.append(self._encoder.encode(message))


def _fields(item: Message) -> list[Any]:
    names = ("frame", "command", "param1", "param2", "param3", "param4", "x", "y", "z")
    return [getattr(item, name) for name in names]
