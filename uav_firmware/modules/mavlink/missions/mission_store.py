"""Stores one type of plan (mission, fence or rally points): check, save, publish.

A plan is replaced as a whole or not at all, in this order: the checks pass, the storage has the new
plan, the topic has it. The checks are spread over calls, because a long mission inside a fence with
many corners takes longer than a control step.

A write that takes longer than `WRITE_LIMIT_US` is abandoned: the plan is refused and the previous
one stays in force. If that write succeeds later, the previous plan is written again, so that
storage and vehicle agree; until then every plan is refused. A restart in between loads the stored
plan.
"""

import errno
from collections.abc import Callable, Generator, Sequence
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.cal.storage import WRITTEN, Storage, Write
from uav_firmware.lib.stepwise import Stepwise
from uav_firmware.modules.mavlink.missions import plan_file
from uav_firmware.modules.mavlink.missions.mission_items import (
    ItemFault,
    StoredItem,
    for_navigator,
    item_for_navigator,
    plan_id,
)
from uav_firmware.modules.mavlink.missions.plan_file import PlanFileError
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.mission import MissionItem, MissionRejection, PlanReview, about_item

MAX_ITEMS: Final = 2000
FILE_NAMES: Final = {
    mavlink.MAV_MISSION_TYPE_MISSION: "mission.plan",
    mavlink.MAV_MISSION_TYPE_FENCE: "geofence.plan",
    mavlink.MAV_MISSION_TYPE_RALLY: "rally.plan",
}

ACCEPTED: Final[int] = mavlink.MAV_MISSION_ACCEPTED
_PACKED_PER_UNIT: Final = 8  # Items converted or packed in 5 us
UNTIL_NEXT_CALL: Final = 1_000_000
"""Amount of work that ends a call; the write is checked again in the next one."""
WRITE_LIMIT_US: Final = 15_000_000
"""Timeout of a write, equal to an uploader's timeout for an item."""
_RETRY_US: Final = 1_000_000
_FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT})

Plan: TypeAlias = tuple[int, int, tuple[MissionItem, ...]]
"""Time of acceptance [us], id and items of a plan."""


class PlanCheck(NamedTuple):
    """Checks of one type of plan before it is accepted."""

    item: Callable[[MissionItem], MissionRejection | None]  # Of a single received item
    plan: Callable[[tuple[MissionItem, ...]], PlanReview]  # Of the complete plan
    stored: Callable[[Sequence[MissionItem]], MissionRejection | None] = lambda _items: None
    """Of a stored plan at boot."""


class Outcome(NamedTuple):
    """Result of storing a plan."""

    result: int  # MAV_MISSION_RESULT
    plan_id: int = 0  # If accepted
    reason: str = ""  # Text for the operator, if refused


Acceptance: TypeAlias = Generator[int, None, Outcome]
"""Stores or refuses a plan in steps; yields the work done, in the unit of PlanReview."""


STORAGE_TIMEOUT: Final = Outcome(
    mavlink.MAV_MISSION_ERROR, reason="not saved: the storage does not answer"
)


class PlanStore:
    """Holds one plan, as uploaded."""

    def __init__(
        self,
        mission_type: int,
        *,
        check: PlanCheck,
        publish: Callable[[Plan], None],
        storage: Storage | None = None,
    ) -> None:
        """Start without a plan; without a storage none survives a restart."""
        self._check = check
        self._publish = publish
        self._storage = storage
        self._mission_type = mission_type
        self._file = FILE_NAMES[mission_type]
        self.items: tuple[StoredItem, ...] = ()
        self.plan_id = 0
        self.is_writing = False
        """Whether a plan is being written, which a peer cannot cancel."""
        self._writing_since_us: int | None = None
        self._is_too_slow = False
        self._now_us = 0
        self._restoring: Stepwise[None] | None = None

    @property
    def is_blocked(self) -> bool:
        """Whether an abandoned write or its repair is in progress; every plan is refused."""
        return self._restoring is not None

    def tick(self, now_us: int) -> None:
        """Time out a write, and repair one that ended too late."""
        self._now_us = now_us
        if self._restoring is not None:
            if self._restoring.advance(1):
                self._restoring = None
        elif not self.is_writing:
            self._writing_since_us = None
        elif self._writing_since_us is None:
            self._writing_since_us = now_us
        elif now_us - self._writing_since_us >= WRITE_LIMIT_US:
            self._is_too_slow = True

    def load(self) -> str:
        """Load and publish the stored plan; return a text if it cannot be used."""
        stored: tuple[StoredItem, ...] = ()
        try:
            stored = self._read()
        except (OSError, PlanFileError) as error:
            fault = getattr(error, "strerror", None) or str(error)
        else:
            fault = self._fault_of_stored(stored)
        used = () if fault else stored
        self._replace(0, used, plan_id(used), for_navigator(used))
        return f"{self._file} is not used: {fault}" if fault else ""

    def fault_of(self, seq: int, item: StoredItem) -> ItemFault | None:
        """Why an item is not allowed in such a plan, or None."""
        rejection = self._check.item(item_for_navigator(seq, item))
        return None if rejection is None else ItemFault(rejection.result, rejection.reason)

    def accept(self, items: Sequence[StoredItem], now_us: int) -> Acceptance:
        """Replace the plan, or refuse it and keep the previous one."""
        if self.is_blocked:
            return STORAGE_TIMEOUT
        packing = len(items) // _PACKED_PER_UNIT
        for_flight = []
        for seq, item in enumerate(items):
            for_flight.append(item_for_navigator(seq, item))
            yield seq % _PACKED_PER_UNIT == 0
        plan = tuple(for_flight)
        rejection = (yield from self._check.plan(plan)) if plan else None
        if rejection is not None:
            return Outcome(rejection.result, reason=about_item(rejection.seq, rejection.reason))
        identifier = plan_id(items)
        yield packing
        contents = plan_file.encode(self._mission_type, items) if items else None
        yield packing
        try:
            write = self._save(contents)
            self.is_writing, self._writing_since_us, self._is_too_slow = True, None, False
            while not write.done():
                if self._is_too_slow:
                    self._restoring = Stepwise(self._restored(write))
                    return STORAGE_TIMEOUT
                yield UNTIL_NEXT_CALL
            write.result()
        except OSError as error:
            full = error.errno in _FULL
            result = mavlink.MAV_MISSION_NO_SPACE if full else mavlink.MAV_MISSION_ERROR
            return Outcome(result, reason=f"not saved: {error.strerror or error}")
        finally:
            self.is_writing = False
        self._replace(now_us, tuple(items), identifier, plan)
        return Outcome(ACCEPTED, identifier)

    def _restored(self, late: Write) -> Generator[int, None, None]:
        """Wait for an abandoned write; write the plan in force again if it succeeds."""
        try:
            yield from _ended(late)
        except OSError:
            return  # The storage still has the plan in force
        while True:
            contents = plan_file.encode(self._mission_type, self.items) if self.items else None
            yield UNTIL_NEXT_CALL
            try:
                yield from _ended(self._save(contents))
            except OSError:
                again_us = self._now_us + _RETRY_US
                while self._now_us < again_us:
                    yield UNTIL_NEXT_CALL
            else:
                return

    def _replace(
        self,
        now_us: int,
        items: tuple[StoredItem, ...],
        identifier: int,
        for_flight: tuple[MissionItem, ...],
    ) -> None:
        self.items, self.plan_id = items, identifier
        self._publish((now_us, identifier, for_flight))

    def _save(self, contents: bytes | None) -> Write:
        if self._storage is None:
            return WRITTEN
        if contents is None:
            return self._storage.remove(self._file)  # Works on full storage too
        return self._storage.save(self._file, contents)

    def _read(self) -> tuple[StoredItem, ...]:
        contents = None if self._storage is None else self._storage.load(self._file)
        return () if contents is None else plan_file.decode(self._mission_type, contents)

    def _fault_of_stored(self, items: Sequence[StoredItem]) -> str:
        """Why a stored plan, possibly of another version, cannot be flown."""
        if len(items) > MAX_ITEMS:
            return f"it has {len(items)} items, limit {MAX_ITEMS}"
        rejection = self._check.stored(for_navigator(items)) if items else None
        return "" if rejection is None else about_item(rejection.seq, rejection.reason)


def _ended(write: Write) -> Generator[int, None, None]:
    """Wait for a write over several calls.

    Raises:
        OSError: if it fails.
    """
    while not write.done():
        yield UNTIL_NEXT_CALL
    write.result()
