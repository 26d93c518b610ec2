"""One vehicle as the broker knows it: its link, its autopilot, its newest telemetry."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from mavlink_broker.autopilots.families import GENERIC, Family, family_of
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.autopilots.status_texts import StatusTexts
from mavlink_broker.mavlink.dialect import Message, Route, boot_ms_of, is_vehicle, mavlink
from mavlink_broker.microservices.command import CommandAlternatives, CommandSequence, RoundTrip
from mavlink_broker.microservices.config_overrides import (
    ParameterOverride,
    ParameterOverrider,
    VehicleOverrides,
)
from mavlink_broker.microservices.link_state import LinkMonitor, LinkState, RebootMonitor
from mavlink_broker.microservices.parameter import ParameterEncoding, encoding_of
from mavlink_broker.planning.situation import ItemLimits, Pose
from mavlink_broker.planning.target_commands import TargetSource
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.armed_period import ArmedPeriod
from mavlink_broker.vehicle.control_authority import (
    ForeignOrder,
    ObservedMode,
    OwnDescent,
    OwnPause,
    order_of_another,
)
from mavlink_broker.vehicle.measurements import MEASURED, Observations
from mavlink_broker.vehicle.recovery_state import RecoveryState
from mavlink_broker.vehicle.telemetry import Snapshot, has_long_uid, uid_of, version

AGED: Final = frozenset({"GLOBAL_POSITION_INT", "ATTITUDE", "BATTERY_STATUS", "MISSION_CURRENT"})
"""Messages whose age is kept, so that old telemetry is not published as new."""
GROUND_TYPES: Final = frozenset({mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_SURFACE_BOAT})
"""MAV_TYPE of what drives or swims."""


@dataclass(slots=True)
class Vehicle:
    """Everything known of one vehicle.

    Its fields are written here alone. `item_limits` and `link` own theirs; those of `recovery` are
    written by whoever begins or ends what a restarted broker has to know.
    """

    vehicle_id: int
    route: Route
    family: Family = GENERIC
    snapshot: Snapshot = field(default_factory=Snapshot)
    observations: Observations = field(default_factory=Observations)
    link: LinkMonitor = field(default_factory=LinkMonitor)
    round_trip: RoundTrip = field(default_factory=RoundTrip)
    recovery: RecoveryState = field(default_factory=RecoveryState)
    target_source: TargetSource | None = None  # Of the target that it follows, if that moves
    item_limits: ItemLimits = field(default_factory=ItemLimits)
    cameras: set[int] = field(default_factory=set)  # Components that are known to be cameras
    product: tuple[int, int] | None = None  # Vendor and product, once received
    capabilities: int = 0  # MAV_PROTOCOL_CAPABILITY bits, once received
    software_version: int = 0  # AUTOPILOT_VERSION.flight_sw_version, once received
    uid: str = ""  # Its own number, hexadecimal, once received
    vehicle_type: int | None = None  # MAV_TYPE
    autopilot: int | None = None  # MAV_AUTOPILOT
    is_identified: bool = False  # It has sent its AUTOPILOT_VERSION, or will not
    are_capabilities_known: bool = False  # As they are: all that it will send of them
    warning: str | None = None  # For an operator: link, dead letters, internal errors
    identity_requests: int = 0  # How often it has had to show again which one it is
    duplicate: str | None = None  # Another vehicle with its system id, which is received too
    _own_pause: OwnPause = field(default_factory=OwnPause)
    _mission_overrides: tuple[ParameterOverride, ...] = ()
    _shows_manual: bool = False  # Its heartbeats show by standard bits who steers it
    _received_at: dict[str, float] = field(default_factory=dict)
    _reboots: RebootMonitor = field(default_factory=RebootMonitor)
    _back_at: float | None = None  # When its link was last back
    _has_long_uid: bool = False  # Its number is that of MAVLink 2
    _may_be_swapped: bool = False  # Its clock has jumped; it has not sent its number since
    _booted_at: float = -math.inf  # Of the newest restart that its clock has proved
    _arming_ordered_at: float = -math.inf
    _status_texts: StatusTexts = field(default_factory=StatusTexts)

    def take(self, message: Message, now: float) -> bool:
        """Handle a message of the vehicle; true when it proves that the vehicle was restarted."""
        kind = message.get_type()
        if kind == "HEARTBEAT" and not is_vehicle(message):
            return False  # Another program sends under the system id of the vehicle
        boot_ms = boot_ms_of(message)
        if (kind == "HEARTBEAT" or boot_ms is not None) and not self.is_connected(now):
            self.doubt(now)  # It is received again
        if kind == "HEARTBEAT":
            self.link.heartbeat_received(now)
            self.autopilot, self.vehicle_type = message.autopilot, message.type
            self.family = family_of(message.autopilot, self.product, message.type)
            self._shows_manual |= control_authority.shows_manual(message.base_mode)
        elif kind == "AUTOPILOT_VERSION":
            self._take_version(message)
        self._status_texts.receive(message, now)
        if kind in AGED:
            self._received_at[kind] = now
        rebooted = boot_ms is not None and self._reboots.sample(kind, boot_ms, now)
        if rebooted and boot_ms is not None:
            self._booted_at = now - boot_ms / 1e3
            self.snapshot.time_s = None  # It was that of before
            if not self.was_ordered_since_boot:
                self._forget_telemetry()
        if boot_ms is not None and self._reboots.has_jumped:
            self._may_be_swapped = True
            self.ask_identity()
        self.snapshot.take(message)
        if kind in MEASURED:
            self.observations.take(message, self.snapshot, now)
        self._follow_arming(kind, now)
        self._observe_foreign_order(message, now)
        return rebooted

    def _take_version(self, message: Message) -> None:
        self.product = message.vendor_id, message.product_id
        self.capabilities = message.capabilities
        self.software_version = message.flight_sw_version
        self.uid, self._has_long_uid = uid_of(message), has_long_uid(message)
        self.is_identified = self.are_capabilities_known = True
        self._may_be_swapped = False
        self.family = family_of(self.autopilot or 0, self.product, self.vehicle_type)

    def _follow_arming(self, kind: str, now: float) -> None:
        if kind != "HEARTBEAT":
            return
        self._own_pause.update(self.mode, now)
        recovery, period = self.recovery, self.armed_period
        if self.snapshot.armed and period.is_armed is False:
            recovery.armed_s = self.snapshot.time_s
        period.update(self.observed_mode, now)
        is_needed = bool(self.snapshot.armed) and not self.family.knows_modes
        recovery.shows_manual = (self._shows_manual or recovery.shows_manual) and is_needed

    def doubt(self, now: float) -> None:
        """Note that it has to show that it is the same: by its clock, or by its number."""
        if self._reboots.is_received(self._back_at):
            self._back_at = now
        else:
            self.ask_identity()

    def _forget_telemetry(self) -> None:
        self._received_at.clear()
        self.recovery.foreign_orders.forget()
        self.armed_period.forget_mode()
        self.snapshot.forget()
        self.observations.forget()
        self._status_texts.clear()

    def replace(self) -> None:
        """Forget what was received: another vehicle has its system id."""
        self._forget_telemetry()
        self._reboots = RebootMonitor()
        self.recovery.forget_armed_period()
        self._back_at, self._may_be_swapped = None, False
        self.ask_identity()

    def is_swapped_for(self, version: Message) -> bool:
        """Whether an AUTOPILOT_VERSION shows that another vehicle stands where this one stood.

        One that is armed is not swapped: the sender has its system id too. A long number and a
        short one may be one vehicle's, over MAVLink 2 and 1.
        """
        number = uid_of(version)
        is_other = number not in {"", self.uid} and self.uid != ""
        are_comparable = has_long_uid(version) == self._has_long_uid
        return is_other and are_comparable and not self.snapshot.armed

    def ask_identity(self) -> None:
        """Note that it may be another vehicle, until it has sent its AUTOPILOT_VERSION again."""
        self.is_identified = self.are_capabilities_known = False
        self.identity_requests += 1

    def _observe_foreign_order(self, message: Message, now: float) -> None:
        """Keep another system's order until the vehicle leaves the mode that it led to."""
        order, orders = order_of_another(message, self.route, now), self.recovery.foreign_orders
        if order is not None and order.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed_period.note_foreign_disarming(now)
        elif order is not None:
            orders.accept(order, now, knows_modes=self.family.knows_modes)
        if message.get_type() == "HEARTBEAT":
            orders.update(self.observed_mode, now)

    @property
    def foreign_order(self) -> ForeignOrder | None:
        """The order of another system that led to the present mode; None: there is none."""
        return self.recovery.foreign_orders.order

    @property
    def overrides(self) -> VehicleOverrides:
        """What the geofence of a plan has changed on it."""
        return self.recovery.overrides

    @property
    def parameters(self) -> ParameterOverrider:
        """What commands have changed on it."""
        return self.recovery.parameters

    @property
    def armed_period(self) -> ArmedPeriod:
        """Who has it in the newest period in which it was armed."""
        return self.recovery.armed_period

    def note_pause_order(self, now: float) -> None:
        """Note that the broker has ordered it to hold."""
        self._own_pause.order(self.family.paused_mode, now)

    def note_arming_order(self, now: float) -> None:
        """Note that the broker has ordered it to arm."""
        self._arming_ordered_at = now
        self.armed_period.order_arming(now)

    @property
    def was_ordered_since_boot(self) -> bool:
        """Whether it was restarted before the broker ordered it to arm, not in the flight since.

        A vehicle whose streams ended with its restart shows its clock when they run again, which
        may be long after.
        """
        return self._booted_at < self._arming_ordered_at

    @property
    def own_descent(self) -> OwnDescent:
        """Its return or landing by order of the broker."""
        return self.recovery.descent

    @property
    def hovers(self) -> bool:
        """Whether it waits in the air where a mission of this broker has left it."""
        return self.recovery.hover.is_held

    def set_hovering(self, *, hovers: bool, in_this_mode: bool = False) -> None:
        """Note whether a mission that has ended has left it in the air.

        `in_this_mode` if it waits for the broker in its present mode, whichever that is.
        """
        hover = self.recovery.hover
        if hovers:
            hover.begin(self.snapshot, self.observed_mode, in_this_mode=in_this_mode)
        else:
            hover.end()

    def begin_descent(self) -> None:
        """Note that it returns or lands by order of the broker."""
        self.own_descent.begin(self.observed_mode, self.snapshot.time_s)
        self.armed_period.claim()

    def update_descent(self, now: float) -> None:
        """Follow whether it flies the return or landing that the broker ordered last."""
        descent = self.own_descent
        was_flown, sought_mode = descent.is_flown, descent.mode if descent.is_sought else None
        descent.update(
            self.observed_mode,
            is_down=self.snapshot.is_on_ground,
            now=now,
            time_s=self.snapshot.time_s,
        )
        if descent.is_flown or (sought_mode is not None and sought_mode == self.flown_mode.mode):
            self.armed_period.claim()
        elif was_flown and self.flown_mode.may_be_others:
            self.armed_period.lose()  # Without effect on one that has landed
            if self.flown_mode.role is ModeRole.OTHER:
                self.armed_period.end_by_others(now)  # Without effect on one that is armed

    def _observe_foreign_landing(self, now: float, *, is_ordered: bool) -> None:
        """Find whether one that was disarmed was not landed by the broker's order.

        Nothing lands one that hovers for the broker; one that comes down shows the mode for that.
        """
        period, hover = self.armed_period, self.recovery.hover
        own_mode, is_theirs = self.own_descent.mode, hover.place is not None
        if own_mode is not None:
            is_other = self.mode_role is not ModeRole.HOLD and self.mode != own_mode
            is_theirs = is_other and self.family.knows_modes
        elif self.own_descent.is_flown or self.recovery.was_sent_down:
            is_theirs = False
        is_seen = hover.is_held and not is_ordered and period.is_armed is False
        if is_theirs and (is_seen or period.has_ended_unseen):
            period.end_by_others(now)

    def update_hover(self, now: float, *, is_ordered: bool) -> None:
        """End a hover with a landing or a takeover; find that of an earlier run again.

        `is_ordered` while a mission or an event orders what the vehicle does.
        """
        self._observe_foreign_landing(now, is_ordered=is_ordered)
        was_held = self.hovers
        self.recovery.hover.update(
            self.snapshot,
            self.observed_mode,
            is_identified=self.is_identified,
            is_ordered=is_ordered,
        )
        if self.hovers:
            self.armed_period.claim()
        elif was_held:
            self.armed_period.lose()

    def identify(self, *, has_answered: bool) -> None:
        """Note that it sends no AUTOPILOT_VERSION; `has_answered` if it receives the requests."""
        self.is_identified = True
        self.are_capabilities_known |= has_answered
        self._may_be_swapped &= not has_answered

    def change_autopilot(self, component: int) -> None:
        """Address a component as its autopilot, and forget what another one sent."""
        self.route = self.route._replace(target_component=component)
        self.ask_identity()
        self.snapshot.forget()

    def add_camera(self, component: int) -> None:
        """Note that a component is a camera."""
        self.cameras.add(component)

    def note_duplicate(self, duplicate: str | None) -> None:
        """Replace the description of another vehicle with its system id; None: there is none."""
        self.duplicate = duplicate

    def warn(self, warning: str | None) -> None:
        """Replace the warning; None for nothing."""
        self.warning = warning

    def forget_foreign_order(self) -> None:
        """Note that an order of the broker is newer."""
        self.recovery.foreign_orders.forget()

    def is_connected(self, now: float) -> bool:
        """Whether its telemetry is fresh."""
        return self.link.state(now) is LinkState.CONNECTED

    def is_reachable(self, now: float) -> bool:
        """Whether its link is not lost; a stale link may still come back."""
        return self.link.state(now) is not LinkState.LOST

    def may_be_restarted(self, now: float) -> bool:
        """Whether it may have been switched off or swapped while its link was away.

        Its clock shows that. One on the ground whose clock has jumped shows its number too.
        """
        may_be_swapped = self._may_be_swapped and not self.snapshot.armed
        back_at = self._back_at
        return may_be_swapped or (back_at is not None and self._reboots.may_show(back_at, now))

    def shows_itself(self, now: float) -> bool:
        """Whether it is received, and what it shows is of the vehicle that was ordered before.

        The first heartbeat behind a lost link may be that of a vehicle which was restarted, or of
        another one with its system id.
        """
        return self.is_connected(now) and not self.may_be_restarted(now)

    def time_s(self, now: float) -> float:
        """Its own time since boot [s]; the broker's clock if it sends none."""
        time_s = self.snapshot.time_s
        return now if time_s is None else time_s

    @property
    def pose(self) -> Pose | None:
        """Its position and heading, once both are known."""
        position, attitude = self.snapshot.position, self.snapshot.attitude
        if position is None or attitude is None:
            return None
        return Pose(*position[:3], attitude.yaw_deg)

    @property
    def version(self) -> str | None:
        """Version of its firmware, once received."""
        return version(self.software_version)

    @property
    def mode(self) -> str:
        """Name of its flight mode."""
        return self.family.mode_name(self.snapshot.base_mode, self.snapshot.custom_mode)

    @property
    def mode_role(self) -> ModeRole:
        """What its flight mode means to a mission."""
        return self._role_of(self.mode)

    def _role_of(self, mode: str) -> ModeRole:
        return ModeRole.HOLD if self._own_pause.holds_in(mode) else self.family.mode_role(mode)

    @property
    def observed_mode(self) -> ObservedMode:
        """What its heartbeat shows about who is in command."""
        mode, knows_modes = self.mode, self.family.knows_modes
        role = self._role_of(mode)
        shows_manual = self._shows_manual or self.recovery.shows_manual
        is_manual = shows_manual and control_authority.is_manual(self.snapshot.base_mode)
        acts = role is ModeRole.ENDING or mode == self.family.paused_mode
        return ObservedMode(
            mode,
            role,
            self.snapshot.armed,
            in_failsafe=self.snapshot.in_failsafe or (acts and self.snapshot.changed_mode_at_fence),
            is_manual=is_manual and not knows_modes,
            ordered=self.foreign_order,
            is_known=knows_modes,
        )

    @property
    def flown_mode(self) -> ObservedMode:
        """The mode of an armed vehicle; of one that is disarmed, the last in which it was armed."""
        return self.armed_period.flown_mode(self.observed_mode)

    @property
    def is_standing_armed(self) -> bool:
        """Whether its propellers may turn while it is on the ground; what drives is never there."""
        if not self.snapshot.armed or self.stays_on_ground:
            return False
        return bool(self.snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)

    @property
    def ready_to_arm(self) -> bool | None:
        """Whether it reports that it would arm in its present mode; None: it does not report that.

        PX4 from 1.14 on reports that its checks pass, and never that it has any.
        """
        since = self.family.reports_only_passed_checks_since
        if self.snapshot.ready_to_arm is None and since is not None:
            return self.snapshot.passes_checks if self.software_version >= since else None
        return self.snapshot.ready_to_arm

    def sequence(
        self,
        alternatives: CommandAlternatives,
        *,
        is_repetition: bool = False,
        sends_until: float = math.inf,
    ) -> CommandSequence:
        """Prepare an order to it: the first alternative of which it accepts every command."""
        versions = self.family.accepts_modes_early
        is_early = versions is not None and versions[0] <= self.software_version < versions[1]
        return CommandSequence(
            alternatives,
            self.route,
            self.round_trip,
            is_repetition=is_repetition,
            accepted_early=frozenset({mavlink.MAV_CMD_DO_SET_MODE} if is_early else ()),
            sends_until=sends_until,
        )

    def override_during_missions(self, overrides: tuple[ParameterOverride, ...]) -> None:
        """Set the parameters that every mission needs, besides those of its segments."""
        self._mission_overrides = overrides

    @property
    def mission_overrides(self) -> tuple[ParameterOverride, ...]:
        """The parameters that every mission needs."""
        return (*self._mission_overrides, *self.family.mission_overrides)

    def override(self, overrides: Sequence[ParameterOverride]) -> None:
        """Request the parameters of the segment that begins, and those of every mission."""
        self.parameters.set_overrides((*self.mission_overrides, *overrides))

    @property
    def is_held_by_failsafe(self) -> bool:
        """Whether it hovers because of its own failsafe, and was not paused by an event.

        ArduPilot shows a failsafe also while that does nothing, as with a low battery by default.
        """
        holds = self.mode_role in {ModeRole.HOLD, ModeRole.PAUSED}
        is_paused = self.recovery.paused is not None
        return bool(self.snapshot.armed) and self.in_failsafe and holds and not is_paused

    @property
    def in_failsafe(self) -> bool:
        """Whether a failsafe of its own acts; ArduPilot shows none where it acts on its fence."""
        return self.observed_mode.in_failsafe

    @property
    def stays_on_ground(self) -> bool:
        """Whether it drives or swims: it lands nowhere, and stays armed where a mission ends."""
        return self.vehicle_type in GROUND_TYPES

    @property
    def has_run_its_mission(self) -> bool:
        """Whether it is on the ground in its mission mode, as ArduPilot is behind a landing.

        Disarmed it forgets its progress, and would run its mission from the first item on; before a
        flight it is ordered into another mode.
        """
        in_mission = self.mode_role is ModeRole.MISSION and self.snapshot.is_on_ground
        return in_mission and self.family.runs_missions_disarmed

    @property
    def parameter_encoding(self) -> ParameterEncoding:
        """How it puts integers into the messages of the parameter protocol."""
        return encoding_of(self.capabilities, self.family.parameter_encoding)

    def status_texts_since(self, time: float) -> str | None:
        """Its latest warnings (STATUSTEXT) since a time, or None."""
        return "; ".join(self._status_texts.since(time)) or None

    def age_s(self, kind: str, now: float) -> float | None:
        """How old its newest message of a kind is (one of AGED); None: none received."""
        received_at = self._received_at.get(kind)
        return None if received_at is None else now - received_at
