"""A vehicle's mission store that follows a script: PX4-like or ArduPilot-like.

What the scripts follow: PX4's `mavlink_mission.cpp` (atomic store, an id over the items, a
repeated last item acknowledged again, MISSION_ERROR when busy) and ArduPilot's
`MissionItemProtocol.cpp` (item 0 is home, float requests, items written one by one, no ids).
"""

import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from tests.support.stored_items import Keeping
from tests.support.vehicle_wire import Message, mavlink, with_plan_ids

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
    unknown_items: frozenset[int] = frozenset()  # Commands answered by UNSUPPORTED
    corrupts_item: int | None = None  # Stored at another altitude
    results: Mapping[int, int] = field(default_factory=dict)  # MAV_RESULT per command
    ready_to_arm_after_s: float = 0.0
    complaint: str = ""  # STATUSTEXT that goes with a refusal
    item_time_s: float = 2.0
    sends_item_reached: bool = True
    has_home: bool = True
    has_timesync: bool = True  # It answers TIMESYNC
    battery_capacity_mah: float | None = 4200.0
    settings: Mapping[str, float] = field(default_factory=dict)  # Parameters that can be set
    ignores_start: bool = False
    keeps: Keeping | None = None  # What becomes of an item in its storage
    is_atomic: bool = True  # Else items are overwritten as they come
    shows_legs_only: bool = False  # MISSION_CURRENT counts only what is navigated to
    mission_every_s: float = 0.2
    sends_current_on_request: bool = True
    sends_mission_state: bool = True
    counts_home: bool = True  # In MISSION_CURRENT.total
    no_mission_total: int = 0
    sends_total: bool = True
    loses_current: bool = False  # After an upload it sends 65535 until one is set
    version: int = 0  # AUTOPILOT_VERSION.flight_sw_version
    has_checks: bool = True  # Else SYS_STATUS reports the checks as passed, but not as present
    most_items: float = math.inf  # Of a mission; more are answered by NO_SPACE
    goes_to_places: bool = True  # Else it never arrives where it was sent
    speed_m_s: float = 10.0  # Over ground, while it flies to a position
    circle_after_s: float = 0.0  # How long it takes to get to a circle, by its centre
    climb_rate_m_s: float = 3.0
    fence_m: float = math.inf  # From home; what leads out is accepted, and not done
    streams_unasked: bool = True
    knows_intervals: bool = True
    is_infeasible: bool = False  # Found after the upload was accepted
    arms_in: frozenset[int] | None = None  # Custom modes; None: in any
    arming_refusal: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    arming_complaint: str = ""
    fault: str = ""  # STATUSTEXT when prearm checks are requested and it is not ready
    link_loss_action: int | None = 0  # NAV_DLL_ACT: above 0 it flies only attended by a station
    needs_station_for_texts: bool = False  # STATUSTEXT only while a GCS sends heartbeats
    readiness_by_mode: bool = False  # "Ready to arm" means: in the mode that it is in
    navigates_after_s: float = 0.0  # Refuses until then the modes that want a position
    checks_are_off: bool = False  # There, but not enabled, and never well
    wants_takeoff_first: bool = False  # Refuses to begin on the ground with anything else
    in_progress: frozenset[int] = frozenset()  # Commands that it works on for 2 s first
    disarms_after_s: float = 0.0  # Once it stands
    disarms_unstarted_s: float = math.inf  # Armed, and not taken off
    sends_landed_state: bool = True
    heartbeats_at_once: bool = True  # Else a change shows with the next one, a second at most
    begins_anew_when_disarmed: bool = False  # It stays in the mission mode, at its first item
    current_goes_to_0_at_the_end: bool = False
    return_changes_mode: bool = False  # The item of a return is done by leaving the mission
    stops_elsewhere: bool = False  # Out of its mission mode a mission counts as not started
    reset_resumes: bool = False  # To set the current item with a reset begins the mission at once
    flies_without_items: bool = True  # Else it refuses its mission mode while it holds no mission
    product: tuple[int, int] = (0, 0)  # Vendor and product in AUTOPILOT_VERSION
    accepts_modes_early: bool = False  # It accepts every mode first, and judges it afterwards
    repeats_pictures: bool = False  # A mission with pictures is resumed at the place before
    manages_gimbal: bool = False  # As PX4 does: only who is in control points it
    is_bare: bool = False  # No camera and no gimbal, and answers as PX4 for them
    refuses_for_others: bool = False  # Bare, it answers for components that are not there: FAILED


PX4 = Script(
    settings={
        "FLW_TGT_ALT_M": 2.0,
        "FLW_TGT_HT": 12.0,
        "FLW_TGT_DST": 5.0,
        "FLW_TGT_FA": 0.0,
        "COM_OF_LOSS_T": 1.0,
    }
)
ARDUPILOT = Script(
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    gives_ids=False,
    home_is_item_0=True,
    float_requests=True,
    forgets_parameters=True,
    stops_elsewhere=True,
    settings={
        "MIS_RESTART": 0.0,
        "CIRCLE_RATE": 20.0,
        "CIRCLE_OPTIONS": 1.0,
        "WPNAV_RADIUS": 200.0,
        "FOLL_ENABLE": 0.0,
        "FOLL_SYSID": 0.0,
        "FOLL_DIST_MAX": 100.0,
        "FOLL_OFS_TYPE": 1.0,
        "FOLL_OFS_X": 0.0,
        "FOLL_OFS_Y": 5.0,
        "FOLL_OFS_Z": 1.0,
        "FOLL_YAW_BEHAVE": 0.0,
        "FOLL_ALT_TYPE": 1.0,
    },
)


class ScriptedMissions:
    """The mission protocol's vehicle end; `send` sends, `stored` is called for a new mission."""

    def __init__(
        self, script: Script, send: Callable[[Message], None], stored: Callable[[], None]
    ) -> None:
        self.script = script
        self.items: list[Message] = []
        self.uploads = 0
        self.refusals = 0
        self.busy_until = 0.0
        self.complain: Callable[[], None] = lambda: None
        self._send = send
        self._stored_call = stored
        self._now = 0.0
        self._transfer: dict[int, Message] = {}
        self._transfer_count = 0
        self._asked_at = 0.0
        self._progress_at = 0.0
        self._acknowledged: Message | None = None
        self._lost_acknowledgements = script.lost_acknowledgements

    def handle(self, message: Message, now: float) -> None:
        """Take a message of the mission protocol; others are ignored."""
        self._now = now
        handlers: Mapping[str, Callable[[Message], None]] = {
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_REQUEST_LIST": self._list,
            "MISSION_REQUEST_INT": self._request,
        }
        handler = handlers.get(message.get_type())
        if handler is not None:
            handler(message)

    def tick(self, now: float) -> None:
        """Ask again, or give up."""
        self._now = now
        if self._transfer_count == 0:
            return
        if now - self._progress_at > _IDLE_TRANSFER_S:
            self._transfer_count = 0
        elif now - self._asked_at >= _REPEAT_REQUEST_S:
            self._ask()

    def drop_transfer(self) -> None:
        """Forget a transfer, as a restart does."""
        self._transfer_count = 0

    @property
    def plan_id(self) -> int:
        """The id of what is stored; 0 for none."""
        if not self.script.gives_ids or not self.items:
            return 0
        text = repr([_fields(item) for item in self.items])
        return zlib.crc32(text.encode()) or 1

    def _count(self, message: Message) -> None:
        if self._now < self.busy_until:
            self._acknowledge(mavlink.MAV_MISSION_ERROR)
            return
        if message.count > self.script.most_items:
            self._acknowledge(mavlink.MAV_MISSION_NO_SPACE)
            return
        self._transfer = {}
        self._transfer_count = message.count
        if not self.script.is_atomic:
            del self.items[message.count :]
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
            self._refuse(mavlink.MAV_MISSION_INVALID_PARAM3)
            return
        if message.command in self.script.unknown_items:
            self._refuse(mavlink.MAV_MISSION_UNSUPPORTED)
            return
        kept = self._stored(message)
        if isinstance(kept, int):
            self._refuse(kept)
            return
        self._transfer[message.seq] = kept
        if not self.script.is_atomic:
            self.items[message.seq : message.seq + 1] = [kept]
        self._progress_at = self._now
        if len(self._transfer) < self._transfer_count:
            self._ask()
        else:
            self._complete()

    def _refuse(self, result: int) -> None:
        self.refusals += 1
        self._transfer_count = 0
        self.complain()
        self._acknowledge(result)

    def _stored(self, message: Message) -> Message | int:
        if self.script.keeps is not None and message.seq >= self.script.home_is_item_0:
            return self.script.keeps(message)
        if message.seq == self.script.corrupts_item:
            message.z += 5.0
        if self.script.forgets_parameters and message.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            message.param2 = message.param3 = message.param4 = 0.0
        return message

    def _complete(self) -> None:
        self.items = [self._transfer[seq] for seq in sorted(self._transfer)]
        self._transfer_count = 0
        self.uploads += 1
        self._stored_call()
        accepted = mavlink.MAVLink_mission_ack_message(0, 0, mavlink.MAV_MISSION_ACCEPTED)
        self._acknowledged = with_plan_ids(accepted, self.plan_id)
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

    def _list(self, message: Message) -> None:
        del message
        count = mavlink.MAVLink_mission_count_message(0, 0, len(self.items))
        self._send(with_plan_ids(count, self.plan_id))

    def _request(self, message: Message) -> None:
        if message.seq < len(self.items):
            item = self.items[message.seq]
            item.target_system = item.target_component = 0
            self._send(item)
        else:
            self._acknowledge(mavlink.MAV_MISSION_INVALID_SEQUENCE)

    def _acknowledge(self, result: int) -> None:
        self._send(mavlink.MAVLink_mission_ack_message(0, 0, result))


def _fields(item: Message) -> list[Any]:
    names = ("frame", "command", "param1", "param2", "param3", "param4", "x", "y", "z")
    return [getattr(item, name) for name in names]
