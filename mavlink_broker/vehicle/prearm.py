"""Judgements about a vehicle before a mission flies; pure."""

import math
from enum import Enum, auto
from typing import Final

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.vehicle import Vehicle

WITHIN_S: Final = 60.0
"""How long a mission waits for its vehicle before it fails."""
ASKED_AFTER_S: Final = 45.0
"""How long a vehicle may not say that it is ready, before it is told to arm and says why not."""
TELLS_ALL_WITHIN_S: Final = 5.0
"""How long a vehicle that is heard may take to tell its battery and attitude; some never do."""


def obstacle(
    vehicle: Vehicle, now: float, *, hovering: bool, waited_s: float = math.inf
) -> str | None:
    """What is lacking before a mission may go onto the vehicle, or None.

    `hovering`: it holds in the air where a mission of ours left it, and may fly on from there.
    """
    snapshot = vehicle.snapshot
    may_navigate = snapshot.can_navigate
    if may_navigate is None:  # It may not have been asked yet
        may_navigate = not vehicle.family.tells_estimate or waited_s >= TELLS_ALL_WITHIN_S
    obstacles = {
        "the vehicle is not heard": not vehicle.is_heard(now),
        "its kind is not known": not vehicle.is_identified,
        "its position is not known": snapshot.position is None,
        "its home is not known": snapshot.home is None,
        "it cannot navigate yet": not may_navigate and not hovering,
        "it is armed": bool(snapshot.armed) and not hovering,
        "it is not ready to arm": _is_unready(vehicle, waited_s) and not hovering,
        "it is in its mission mode": vehicle.has_run_its_mission and not hovering,
    }
    return next((obstacle for obstacle, there in obstacles.items() if there), None)


def _is_unready(vehicle: Vehicle, waited_s: float) -> bool:
    """Whether it says that it would not arm; one that only never says that it would is asked to."""
    is_inferred = vehicle.snapshot.ready_to_arm is None
    return vehicle.ready_to_arm is False and not (is_inferred and waited_s >= ASKED_AFTER_S)


def wants_another_mode(vehicle: Vehicle) -> bool:
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


class Attachment(Enum):
    """What is to be done about a mission that an earlier run of the broker accepted."""

    WAIT = auto()  # Not enough is known yet
    BEGIN = auto()  # It was never started: from scratch
    COMPARE = auto()  # The vehicle may be flying it: compare what it holds


def attachment(
    vehicle: Vehicle,
    now: float,
    *,
    started: bool,
    waited_s: float,
    heard_s: float,
) -> Attachment:
    """Judge; `started` if the mission has been reported to run.

    A started mission is never begun again: the vehicle is waited for as long as it takes. It has
    been heard for `heard_s`: what ended meanwhile is told with its place and battery, or not yet.
    """
    snapshot = vehicle.snapshot
    if not vehicle.is_heard(now) or snapshot.armed is None or not vehicle.is_identified:
        patient = started or waited_s < WITHIN_S
        return Attachment.WAIT if patient else Attachment.BEGIN
    if not started and snapshot.is_on_ground:
        return Attachment.BEGIN
    newest = snapshot.attitude, snapshot.battery_fraction, snapshot.mission
    has_told_all = None not in newest
    is_placed = snapshot.home is not None and snapshot.position is not None
    if not is_placed or not (has_told_all or heard_s >= TELLS_ALL_WITHIN_S):
        return Attachment.WAIT
    return Attachment.WAIT if not started and _is_about_to_disarm(vehicle) else Attachment.COMPARE


def _is_about_to_disarm(vehicle: Vehicle) -> bool:
    """Armed on the ground and not told to start: it will take off or disarm by itself."""
    on_ground = vehicle.snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    return on_ground and vehicle.mode_role is not ModeRole.MISSION
