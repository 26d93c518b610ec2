"""One vehicle as the broker sees it: its link, its family, its newest words."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.autopilots.families import GENERIC, Family, family_of
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.borrowed_config import Loan
from mavlink_broker.microservices.borrowed_parameters import Loan as Wish
from mavlink_broker.microservices.borrowed_parameters import ParameterKeeper
from mavlink_broker.microservices.heartbeat import LinkState, LinkWatch, is_vehicle
from mavlink_broker.microservices.parameter_write import ParameterEncoding, encoding_of
from mavlink_broker.microservices.reboot import RebootWatch
from mavlink_broker.microservices.round_trip import RoundTrip
from mavlink_broker.microservices.status_text import StatusTexts
from mavlink_broker.planning.situation import Home
from mavlink_broker.planning.target_track import Lead
from mavlink_broker.recovery.progress import Diary
from mavlink_broker.recovery.record import AbortNote, Homeward, LiveNote, Memo, Pose, merged
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import ForeignOrder, Seen
from mavlink_broker.vehicle.measurement_lists import Observations
from mavlink_broker.vehicle.telemetry import Snapshot

AGED: Final = frozenset({"GLOBAL_POSITION_INT", "ATTITUDE", "BATTERY_STATUS", "MISSION_CURRENT"})
"""Messages whose age is kept: what is told of a vehicle must not look fresher than it is."""

GROUND_KINDS: Final = frozenset({mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_SURFACE_BOAT})
"""MAV_TYPE of what drives or swims."""

HOME_PATIENCE_S: Final = 20.0
"""How long a vehicle that stands may take to tell its home; some never do."""

SHOWN_WITHIN_S: Final = 1.5
"""After its acknowledgement a mode shows in a heartbeat: a period of those, and half of one."""

JUDGED_WITHIN_S: Final = 3.0
"""How long a vehicle whose link was away may take to show whether it was restarted meanwhile."""

OF_THE_PAST: Final = frozenset({"CAMERA_IMAGE_CAPTURED"})
"""Their times are of what they tell of, which may be long ago."""


@dataclass(slots=True)
class Vehicle:
    """Everything known of one vehicle."""

    vehicle_id: int
    route: Route
    family: Family = GENERIC
    snapshot: Snapshot = field(default_factory=Snapshot)
    observations: Observations = field(default_factory=Observations)
    link: LinkWatch = field(default_factory=LinkWatch)
    round_trip: RoundTrip = field(default_factory=RoundTrip)
    product: tuple[int, int] | None = None  # Vendor and product, once it has told them
    is_identified: bool = False  # It has told them, or will not
    capabilities: int = 0  # MAV_PROTOCOL_CAPABILITY bits, once it has told them
    software_version: int = 0  # AUTOPILOT_VERSION.flight_sw_version, once it has told it
    kind: int | None = None  # MAV_TYPE
    autopilot: int | None = None  # MAV_AUTOPILOT
    warning: str | None = None  # What somebody should know about its link
    loan: Loan = field(default_factory=Loan)  # What a plan's fence has changed on it
    parameters: ParameterKeeper = field(default_factory=ParameterKeeper)  # What is borrowed of it
    lasting: tuple[Wish, ...] = ()  # What is borrowed of it during all of every mission
    lead: Lead | None = None  # Whom it follows, if somebody that moves
    most_items: int | None = None  # That a mission of it may hold, once it has refused more
    refused_items: set[int] = field(default_factory=set)  # MAV_CMD that no mission of it may hold
    cameras: set[int] = field(default_factory=set)  # Components that are known to be cameras
    uid: str = ""  # Its own number, hexadecimal, once it has told one
    diary: Diary = field(default_factory=Diary)
    hovers: bool = False  # It waits in the air where a mission of ours has left it
    hover: Pose | None = None  # Where that is; of an earlier run, until that has been judged
    homeward: Homeward | None = None  # It is to go home, and has not obeyed yet
    abort: AbortNote | None = None  # It was accepted, and the vehicle has not obeyed yet
    owed_abort: AbortNote | None = None  # Done, but for missions that may be handed out again
    live: LiveNote | None = None  # The live command that it was told last
    started: str | None = None  # First command of the items that it was ordered to fly last
    is_taken: bool = False  # Somebody else has taken it from a mission; until it is disarmed
    ordered: ForeignOrder | None = None  # By another system, in the mode that it is in
    _waits: bool = False  # By its newest heartbeat, in a mode in which it waits or is led
    _tells_manual: bool = False  # Its heartbeats tell by standard bits who steers it
    _heard_at: dict[str, float] = field(default_factory=dict)
    _reboots: RebootWatch = field(default_factory=RebootWatch)
    _back_at: float | None = None  # When its link was last back
    _words: StatusTexts = field(default_factory=StatusTexts)

    def take(self, message: Message, now: float) -> bool:
        """Learn from a message of the vehicle; true when it proves that it was restarted."""
        kind = message.get_type()
        if kind == "HEARTBEAT" and not is_vehicle(message):
            return False  # Who else speaks under its numbers is not the vehicle
        if kind == "HEARTBEAT":
            if self.link.state(now) is not LinkState.CONNECTED and self._is_clock_judged:
                self._back_at = now
            self.link.heard(now)
            self.autopilot, self.kind = message.autopilot, message.type
            self.family = family_of(message.autopilot, self.product, message.type)
            self._tells_manual |= control_authority.tells_manual(message.base_mode)
        elif kind == "AUTOPILOT_VERSION":
            self.product = message.vendor_id, message.product_id
            self.capabilities = message.capabilities
            self.software_version = message.flight_sw_version
            self.uid = uid_of(message)
            self.is_identified = True
            self.family = family_of(self.autopilot or 0, self.product, self.kind)
        self._words.receive(message, now)
        if kind in AGED:
            self._heard_at[kind] = now
        boot_ms: int | None = None
        if kind not in OF_THE_PAST:
            boot_ms = getattr(message, "time_boot_ms", None)
        rebooted = boot_ms is not None and self._reboots.sample(kind, boot_ms, now)
        if rebooted:
            self._heard_at.clear()
            self.ordered = None
            self.snapshot.forget()
            self.observations.forget()
            self._words.clear()
        self.snapshot.take(message)
        self.observations.take(message, self.snapshot, now)
        self.is_taken = self.is_taken and self.snapshot.armed is not False
        self._see_orders(message, now)
        return rebooted

    def _see_orders(self, message: Message, now: float) -> None:
        """Learn of another system's order, until the vehicle leaves the mode that it led to.

        One that waited and waits no more has left it at once: the order has resumed the mission.
        """
        ours = frozenset({self.route.own_system, self.route.target_system})
        order = control_authority.foreign_order(message, ours, now)
        self.ordered = order or self.ordered
        if message.get_type() != "HEARTBEAT":
            return
        waited = self._waits
        self._waits = self.mode_role in {ModeRole.HOLD, ModeRole.GUIDED, ModeRole.PAUSED}
        if self.ordered is None:
            return
        is_shown = waited or now - self.ordered.at > SHOWN_WITHIN_S
        if not self.snapshot.armed or (is_shown and not self._waits):
            self.ordered = None

    @property
    def memo(self) -> Memo:
        """What of it a broker has to know in its next life."""
        return Memo(
            plans=dict(self.loan.plans),
            values=dict(self.loan.values),
            borrowed=self.parameters.borrowed,
            hover=self.hover,
            homeward=self.homeward,
            abort=self.abort or self.owed_abort,
            live=self.live,
            started=self.started,
        )

    def recall(self, memo: Memo) -> None:
        """Learn what an earlier run of the broker has noted."""
        both = merged(memo, self.memo)
        self.loan.plans, self.loan.values = dict(both.plans), dict(both.values)
        self.parameters.recall(both.borrowed)
        self.hover, self.homeward, self.live = both.hover, both.homeward, both.live
        self.abort, self.started = both.abort, both.started

    def forget(self) -> None:
        """Start anew with what is noted: it is another vehicle."""
        self.loan, self.parameters = Loan(), ParameterKeeper()
        self.hover = self.homeward = self.live = self.started = None
        self.abort = self.owed_abort = None
        self.hovers = False

    @property
    def is_noted(self) -> bool:
        """Whether a broker that is killed now knows all this again."""
        return self.diary.is_kept(self.memo)

    def link_state(self, now: float) -> LinkState:
        """Judge its link."""
        return self.link.state(now)

    def is_connected(self, now: float) -> bool:
        """Whether what it tells is fresh."""
        return self.link.state(now) is LinkState.CONNECTED

    def is_heard(self, now: float) -> bool:
        """Whether it can be spoken to; a stale link may still come back."""
        return self.link.state(now) is not LinkState.LOST

    @property
    def _is_clock_judged(self) -> bool:
        """Whether it sends its time since boot, and has since its link was last back."""
        since = -math.inf if self._back_at is None else self._back_at
        return self._reboots.judged_at > -math.inf and self._reboots.judged_at >= since

    def may_be_restarted(self, now: float) -> bool:
        """Whether it may have been switched off while its link was away: its clock shows that."""
        if self._back_at is None or now - self._back_at >= JUDGED_WITHIN_S:
            return False
        return self._reboots.judged_at < self._back_at

    @property
    def version(self) -> str | None:
        """Version of its firmware, once it has told it."""
        return version(self.software_version)

    @property
    def mode(self) -> str:
        """Name of its flight mode."""
        return self.family.mode_name(self.snapshot.base_mode, self.snapshot.custom_mode)

    @property
    def mode_role(self) -> ModeRole:
        """What its flight mode means to a mission."""
        return self.family.mode_role(self.mode)

    @property
    def seen(self) -> Seen:
        """What its heartbeat says about who steers it."""
        snapshot = self.snapshot
        is_manual = self._tells_manual and control_authority.is_manual(snapshot.base_mode)
        return Seen(
            self.mode,
            self.mode_role,
            snapshot.armed,
            in_failsafe=snapshot.in_failsafe,
            is_manual=is_manual and not self.family.knows_modes,
            ordered=self.ordered,
        )

    @property
    def is_standing_armed(self) -> bool:
        """Whether its propellers may turn while it is on the ground; what drives is never there."""
        if not self.snapshot.armed or self.stays_on_ground:
            return False
        return bool(self.snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)

    @property
    def ready_to_arm(self) -> bool | None:
        """Whether it would arm in the mode that it is in, as it tells; None: it does not tell.

        PX4 from 1.14 on tells that its checks pass, and never that it has any.
        """
        since = self.family.tells_only_passed_checks_since
        if self.snapshot.ready_to_arm is None and since is not None:
            return self.snapshot.passes_checks if self.software_version >= since else None
        return self.snapshot.ready_to_arm

    def borrow(self, wishes: Sequence[Wish]) -> None:
        """Borrow parameters for the part of a mission that begins, and what all of it needs."""
        self.parameters.want((*self.lasting, *wishes))

    @property
    def is_held_by_failsafe(self) -> bool:
        """Whether it hovers because a failsafe of its own says so, and nobody has paused it."""
        snapshot = self.snapshot
        holds = self.mode_role in {ModeRole.HOLD, ModeRole.PAUSED}
        return bool(snapshot.armed) and snapshot.in_failsafe and holds

    @property
    def stays_on_ground(self) -> bool:
        """Whether it drives or swims: it lands nowhere, and stays armed where a mission ends."""
        return self.kind in GROUND_KINDS

    @property
    def has_run_its_mission(self) -> bool:
        """Whether it stands in its mission mode as ArduPilot does behind a landing.

        Disarmed it forgets how far it was, and goes through its mission from the first item on;
        before a flight it is taken out of that mode.
        """
        in_mission = self.mode_role is ModeRole.MISSION and self.snapshot.is_on_ground
        return in_mission and self.family.runs_missions_disarmed

    @property
    def parameter_encoding(self) -> ParameterEncoding:
        """How it puts integers into the messages of the parameter protocol."""
        return encoding_of(self.capabilities, self.family.parameter_encoding)

    def assume_home(self, now: float, homeless_since: float | None) -> float | None:
        """Take the place where it stands for home if it does not tell; gives since when it lacks.

        Its two altitudes differ by home's. Only on the ground, where home is about to be set.
        """
        snapshot = self.snapshot
        stands = snapshot.is_on_ground and self.is_heard(now)
        if snapshot.home is not None or snapshot.position is None or not stands:
            return None
        since = now if homeless_since is None else homeless_since
        if now - since >= HOME_PATIENCE_S and snapshot.home_amsl_m is not None:
            snapshot.home = Home(*snapshot.position[:2], snapshot.home_amsl_m)
        return since

    def words_since(self, time: float) -> str | None:
        """Its latest complaints since a time, or None."""
        return "; ".join(self._words.since(time)) or None

    def age_s(self, kind: str, now: float) -> float | None:
        """How old its newest message of a kind is (one of AGED); None: it has told none."""
        heard_at = self._heard_at.get(kind)
        return None if heard_at is None else now - heard_at


def uid_of(told: Message) -> str:
    """Read AUTOPILOT_VERSION's number of the hardware: the long one, else the short one."""
    long_one = bytes(told.uid2).rstrip(b"\0")
    if long_one:
        return long_one.hex()
    return f"{told.uid:016x}" if told.uid else ""


def version(number: int) -> str | None:
    """Read AUTOPILOT_VERSION.flight_sw_version: major, minor and patch in its upper bytes."""
    if number == 0:
        return None
    return ".".join(str(number >> shift & 0xFF) for shift in (24, 16, 8))
