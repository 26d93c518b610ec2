"""Reads the plan that the user names: a file, or `-` for the standard input.

It accepts every form that the edge server accepts: envelopes, bare missions, imported spellings.
The rules of a whole plan are checked too, with the limits of an unregistered vehicle.
"""

import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from afarcloud import rules, wire
from afarcloud.annex import in_seconds
from afarcloud.enumerations import Profile
from afarcloud.faults import DocumentError, Fault
from afarcloud.flyable import VehicleLimits
from afarcloud.plan import Mission, Plan
from mavlink_broker.cli.program import FAILED, UsageError

STANDARD_INPUT = "-"


def read_plan(path: str, now: datetime) -> tuple[Plan, tuple[str, ...]]:
    """Give the plan and the warnings of the rules.

    Raises:
        UsageError: if it cannot be read, or may not be flown.
    """
    try:
        plan = wire.read_plan(_bytes(path))
    except DocumentError as error:
        raise UsageError(_sentences(path, error.faults), FAILED) from error
    limits = {mission.vehicle_id: VehicleLimits() for mission in plan.missions}
    result = rules.check(plan, limits, now)
    if result.faults:
        raise UsageError(_sentences(path, result.faults), FAILED)
    return plan, tuple(f"{warning.path}: {warning.message}" for warning in result.warnings)


def select_missions(
    plan: Plan, mission_id: int | None, vehicle_id: int | None
) -> tuple[Mission, ...]:
    """Give the selected missions, or all; times in seconds.

    Raises:
        UsageError: if the plan has no such mission.
    """
    missions = tuple(
        mission
        for mission in plan.missions
        if mission_id in {None, mission.mission_id} and vehicle_id in {None, mission.vehicle_id}
    )
    if not missions:
        there = ", ".join(f"{m.mission_id} (vehicle {m.vehicle_id})" for m in plan.missions)
        raise UsageError(f"the plan has no such mission, only {there}")
    is_annex = plan.profile is Profile.ANNEX
    return tuple(in_seconds(mission) for mission in missions) if is_annex else missions


def _bytes(path: str) -> bytes:
    if path == STANDARD_INPUT:
        return sys.stdin.buffer.read()
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error


def _sentences(path: str, faults: Sequence[Fault]) -> str:
    lines = (f"{fault.path or 'document'}: {fault.message}" for fault in faults)
    return "\n".join((f"{path} cannot be flown:", *(f"  {line}" for line in lines)))
