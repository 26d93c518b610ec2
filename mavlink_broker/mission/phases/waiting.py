"""WAITING: a mission waits until its vehicle is connected, has a position and is ready to arm.

While somebody else has armed it, and for `STAND_S` afterwards, it waits without a limit of its own:
how long a pilot flies says nothing of the vehicle. Until then nothing is ordered, for the pilot may
be about to arm it again; `VEHICLE_WITHIN_S` begins afterwards. The mission may expire meanwhile.

It also waits until the edge server has confirmed its acceptance. Reports and acceptances of one
vehicle are sent in order, so the edge server knows the end of the former mission by then. Without
that, a broker that is killed between the transfer and the report leaves a vehicle with the items of
a mission that the edge server does not know, and the former mission cannot be judged by them.
"""

import logging
import math
from typing import Final

from afarcloud.commands import FLYING
from afarcloud.enumerations import CommandType
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.context import TELEMETRY_WITHIN_S, VEHICLE_WITHIN_S, MissionContext
from mavlink_broker.mission.phases.phase import Fault, Phase, Result
from mavlink_broker.mission.states import Event
from mavlink_broker.planning.situation import RefusedError
from mavlink_broker.vehicle.armed_period import OBSTACLES, STAND_S
from mavlink_broker.vehicle.control_authority import DESCENDING, HOVERING, ON_GROUND, Claim
from mavlink_broker.vehicle.vehicle import Vehicle

LOGGED_AFTER_S: Final = 3.0
"""How long a mission waits before the log names the obstacle."""
MODE_EVERY_S: Final = 2.0
"""Longer than a mode takes to show in a heartbeat."""
CHECKS_EVERY_S: Final = 14.0
"""Longer than a vehicle's own retries, and often enough for its newest reason."""
ARMED_UNREADY_AFTER_S: Final = 45.0
"""How long a vehicle may not report that it is ready before it is ordered to arm."""

REPORTED_EVERY_S: Final = 5.0
"""How often a mission reports how long its vehicle has stood since somebody else's flight."""
WAITED: Final = f"stood for {STAND_S:.0f} s first: somebody else or its failsafe had it"

_LOG = logging.getLogger(__name__)


class Waiting(Phase):
    """Before the transfer to the vehicle."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self._entered_at = 0.0
        self._mode_ordered_at = -math.inf  # The vehicle is not ready in the mode that it is in
        self._checks_requested_at = -math.inf
        self._obstacle: str | None = None  # That was logged last
        self._reported_at = -math.inf  # What is waited for because of somebody else
        self._message_before: str | None = None  # Of the mission

    @property
    def claim(self) -> Claim:
        """A vehicle that flew a segment of this mission comes down by itself."""
        if self._mission.is_hovering:
            return HOVERING
        return DESCENDING if self._mission.is_start_ordered else ON_GROUND

    def enter(self, now: float, effects: Effects) -> Result:
        """Begin to wait."""
        del effects
        self._entered_at = now
        return None

    def _end_expired(self, effects: Effects) -> Result:
        """Report that it has expired, once the edge server has confirmed its acceptance.

        One that the edge server has ended itself is dropped with that answer, and not reported.
        """
        if not self._mission.is_confirmed:
            return None
        self._mission.expire(effects)
        return Event.ENDED

    def tick(self, now: float, effects: Effects) -> Result:
        """Go on when nothing is lacking; fail after `VEHICLE_WITHIN_S`."""
        mission, vehicle = self._mission, self._vehicle
        if mission.is_expired(now):
            return self._end_expired(effects)
        mission.is_hovering |= vehicle.hovers  # Its heartbeat may have arrived after `begin`
        if vehicle.snapshot.armed is False and not mission.is_start_ordered:
            mission.is_hovering = False  # Somebody has landed it
        if self._waits_for_others(now, effects):
            return None
        waited_s = now - self._entered_at
        obstacle = find_obstacle(
            vehicle,
            now,
            hovering=mission.is_hovering,
            waited_s=waited_s,
            wants_fence=mission.area is not None or bool(mission.work.rally_spots),
        )
        self._log_obstacle(obstacle, waited_s)
        if obstacle is None:
            return self._begin_transfer() if mission.is_confirmed else None
        self._request_checks(now, effects)
        if _may_be_ready_in_another_mode(vehicle) and now >= self._mode_ordered_at + MODE_EVERY_S:
            self._mode_ordered_at = now
            effects.messages.append(exchanges.hold_on_ground(vehicle))
        if waited_s >= VEHICLE_WITHIN_S:
            return Fault(f"not ready after {VEHICLE_WITHIN_S:.0f} s: {obstacle}")
        return None

    def _waits_for_others(self, now: float, effects: Effects) -> bool:
        """Whether somebody else has the vehicle or has just left it; the report says so."""
        mission, period = self._mission, self._vehicle.armed_period
        if mission.is_hovering or not self._vehicle.is_reachable(now):
            return False
        obstacle = period.obstacle(now)
        message = mission.ledger.message or ""  # Perhaps that of an earlier run
        is_reported = message.startswith(OBSTACLES)
        if obstacle is not None:
            self._entered_at = now
            self._log_obstacle(obstacle, LOGGED_AFTER_S)
        if mission.is_confirmed and (is_reported or obstacle is not None):
            text = period.warning(now) or obstacle or self._message_before or WAITED
            is_due = now >= self._reported_at + REPORTED_EVERY_S
            if is_due or obstacle is None or not message.startswith(obstacle):
                self._message_before = self._message_before if is_reported else message
                self._reported_at = now
                mission.ledger.replace_message(text)
                mission.report(effects)
        return obstacle is not None

    def _log_obstacle(self, obstacle: str | None, waited_s: float) -> None:
        """Log what a mission waits for, after `LOGGED_AFTER_S` and whenever it changes."""
        if obstacle == self._obstacle or (obstacle is not None and waited_s < LOGGED_AFTER_S):
            return
        mission_id, vehicle_id = self._mission.work.mission.mission_id, self._vehicle.vehicle_id
        if obstacle is None:
            _LOG.info("mission %d no longer waits for vehicle %d", mission_id, vehicle_id)
        else:
            _LOG.warning("mission %d waits for vehicle %d: %s", mission_id, vehicle_id, obstacle)
        self._obstacle = obstacle

    def _request_checks(self, now: float, effects: Effects) -> None:
        """Request the arming checks of a vehicle that is not ready.

        Most vehicles have sent their reasons before the broker was connected.
        """
        is_ready = self._vehicle.ready_to_arm is not False or bool(self._vehicle.snapshot.armed)
        if is_ready or now - max(self._checks_requested_at, self._entered_at) < CHECKS_EVERY_S:
            return
        self._checks_requested_at = now
        effects.messages.append(exchanges.arming_checks(self._vehicle))

    def _begin_transfer(self) -> Result:
        mission = self._mission
        try:
            mission.translate()
            mission.check_area()
        except RefusedError as error:
            return Fault(error.reason, error.command_index)
        is_live = mission.is_live
        moves = mission.segments.live.action.moves if is_live else self._begins_in_the_air
        if moves and not mission.is_flying:
            return Fault("the vehicle is on the ground: a take-off has to come first")
        return Event.READY

    @property
    def _begins_in_the_air(self) -> bool:
        """Whether the mission begins with a landing or a return, which needs a hover."""
        mission = self._mission
        kinds = (one.command_type_id for one in mission.work.mission.command_array)
        first = next((kind for kind in kinds if kind in FLYING), None)
        is_for_air = first in {CommandType.NAV_LAND, CommandType.NAV_HOME}
        return is_for_air and mission.segments.is_first and not self._vehicle.stays_on_ground


def find_obstacle(
    vehicle: Vehicle, now: float, *, hovering: bool, waited_s: float, wants_fence: bool
) -> str | None:
    """Name what is lacking before the transfer to the vehicle, or None.

    `hovering`: it holds in the air where a mission of this broker left it, and may fly on. On the
    ground nobody knows which one of two vehicles with one system id a mission is for.
    `wants_fence`: a geofence or rally points are to be placed. One that has not answered yet, over
    a link of one direction, would be taken for one that keeps none.
    """
    snapshot = vehicle.snapshot
    may_navigate = snapshot.can_navigate
    if may_navigate is None:  # Not requested yet, perhaps
        may_navigate = not vehicle.family.reports_estimator or waited_s >= TELEMETRY_WITHIN_S
    obstacles = {
        "the vehicle is not connected": not vehicle.is_reachable(now),
        str(vehicle.duplicate): vehicle.duplicate is not None and not hovering,
        "its kind is not known": not vehicle.is_identified,
        "it has not answered whether it keeps a geofence": (
            wants_fence and not vehicle.are_capabilities_known
        ),
        "its position is not known": snapshot.position is None,
        "its home is not known": snapshot.home is None,
        "it cannot navigate yet": not may_navigate and not hovering,
        "it is armed": bool(snapshot.armed) and not hovering,
        "it is not ready to arm": _is_unready(vehicle, waited_s) and not hovering,
        "it is in its mission mode": vehicle.has_run_its_mission and not hovering,
    }
    return next((obstacle for obstacle, there in obstacles.items() if there), None)


def _is_unready(vehicle: Vehicle, waited_s: float) -> bool:
    """Whether it would not arm; readiness that is only inferred counts for a limited time."""
    is_inferred = vehicle.snapshot.ready_to_arm is None
    return vehicle.ready_to_arm is False and not (is_inferred and waited_s >= ARMED_UNREADY_AFTER_S)


def _may_be_ready_in_another_mode(vehicle: Vehicle) -> bool:
    """Whether a vehicle may be not ready to arm only because of the mode that it is in.

    PX4 judges its readiness for that mode: without a remote control it is never ready to be flown
    by one, behind a return or a landing it stays in a mode in which it does not arm, and in its
    mission mode it is ready with a mission only.
    ArduPilot in AUTO would begin a new mission before its propellers turn.
    """
    snapshot = vehicle.snapshot
    if vehicle.has_run_its_mission:
        return snapshot.can_navigate is not False
    waits = snapshot.armed is False and vehicle.ready_to_arm is False
    return waits and vehicle.family.readiness_by_mode and vehicle.mode_role is not ModeRole.HOLD
