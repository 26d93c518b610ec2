"""Reads the work that the edge server hands out, once each.

The edge server may give the same work again: after a restart on either side everything
unfinished is asked for anew.

WorkError  a piece of work that cannot be read, with its number where it has one
"""

from collections import OrderedDict
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final

from pydantic import ValidationError

from afarcloud.plan import Mission
from afarcloud.state import MissionReport
from mavlink_broker.work import MissionWork, StateVectorWork, Work

REMEMBERED: Final = 10_000


class WorkError(Exception):
    """Work that cannot be read."""

    def __init__(self, work_id: int | None, reason: str) -> None:
        super().__init__(reason)
        self.work_id = work_id


class Inbox:
    """Remembers what was taken."""

    def __init__(self) -> None:
        self._taken: OrderedDict[tuple[Any, ...], None] = OrderedDict()

    def read(self, raw: Mapping[str, Any], now: float, utc: datetime) -> Work | None:
        """Turn raw work into its type; None when it was taken before, or is of another kind.

        Raises:
            WorkError: if it cannot be read.
        """
        work_id = raw.get("id")
        if not isinstance(work_id, int):
            raise WorkError(None, "work without a number")
        work: Work
        try:
            if raw.get("kind") == "mission":
                work = _mission(raw, work_id, now, utc)
                key: tuple[Any, ...] = work.key
            elif raw.get("kind") == "latest_state_vector":
                work = StateVectorWork(
                    work_id=work_id,
                    vehicle_id=raw.get("vehicle_id"),
                    expires_at=_on_our_clock(raw.get("expires_at"), now, utc),
                )
                key = (work_id, "latest_state_vector", raw.get("sequence_number"))
            else:
                raise WorkError(work_id, f"work of kind {raw.get('kind')} is not done here")
        except (KeyError, ValidationError, ValueError) as error:
            raise WorkError(work_id, f"work cannot be read: {error}") from error
        return work if self._is_new(key) else None

    def _is_new(self, key: tuple[Any, ...]) -> bool:
        if key in self._taken:
            return False
        self._taken[key] = None
        if len(self._taken) > REMEMBERED:
            self._taken.popitem(last=False)
        return True


def _mission(raw: Mapping[str, Any], work_id: int, now: float, utc: datetime) -> MissionWork:
    report = raw.get("report")
    mission = Mission.model_validate(raw["mission"])
    return MissionWork(
        work_id=work_id,
        plan_id=str(raw.get("plan_id")),
        vehicle_id=mission.vehicle_id,
        mission=mission,
        was_accepted=raw.get("state") == "accepted",
        report=None if report is None else _report(report),
        expires_at=_on_our_clock(raw.get("expires_at"), now, utc),
    )


def _report(raw: Mapping[str, Any]) -> MissionReport:
    """Read the last report; what the edge server added to it is its own affair."""
    known = {name: value for name, value in raw.items() if name in MissionReport.model_fields}
    return MissionReport.model_validate(known)


def _on_our_clock(text: str | None, now: float, utc: datetime) -> float | None:
    """Turn a time of day into one of the program's clock."""
    if text is None:
        return None
    return now + (datetime.fromisoformat(text) - utc).total_seconds()
