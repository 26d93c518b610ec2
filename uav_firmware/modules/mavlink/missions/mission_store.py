"""One kind of plan (mission, fence or rally points): judged, kept over a restart, handed on.

A plan is replaced whole or not at all, in this order: the judges agree, the medium holds the
new one, everybody aboard sees it. Judging is spread over calls, because a long mission inside
a fence of many corners takes longer than a control step.

A medium that has not taken a plan after `WRITE_LIMIT_US` is not waited for: the plan is refused
and the former one stays in force. Should that write end well after all, the former plan is written
again, so that medium and vehicle agree; until then nothing else is taken. A restart meanwhile finds
what the medium holds.
"""

import errno
from collections.abc import Callable, Generator, Sequence
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.cal.storage import WRITTEN, Storage, Write
from uav_firmware.lib.stepwise import Stepwise, finished
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
from uav_firmware.msg.mission import MissionItem, MissionRejection, PlanReview

MAX_ITEMS: Final = 2000
FILE_NAMES: Final = {
    mavlink.MAV_MISSION_TYPE_MISSION: "mission.plan",
    mavlink.MAV_MISSION_TYPE_FENCE: "geofence.plan",
    mavlink.MAV_MISSION_TYPE_RALLY: "rally.plan",
}

ACCEPTED: Final[int] = mavlink.MAV_MISSION_ACCEPTED
_PACKED_PER_UNIT: Final = 8  # Items that are converted or packed in 5 us
_UNTIL_NEXT_CALL: Final = 1_000_000
"""Work that ends a call, whatever its budget: the medium is looked at again in the next one."""
WRITE_LIMIT_US: Final = 15_000_000
"""How long the medium may take for a plan; an uploader waits no longer for an item either."""
_RETRY_US: Final = 1_000_000
_FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT})

Plan: TypeAlias = tuple[int, int, tuple[MissionItem, ...]]
"""Time of acceptance [us], id, items."""


class PlanCheck(NamedTuple):
    """Who judges one kind of plan before it is accepted."""

    item: Callable[[MissionItem], MissionRejection | None]  # By itself, as it comes in
    plan: Callable[[Sequence[MissionItem]], PlanReview]  # As a whole, when it is complete


class Verdict(NamedTuple):
    """What became of a whole plan."""

    result: int  # MAV_MISSION_RESULT
    plan_id: int = 0  # Of the plan stored, when accepted
    reason: str = ""  # For the operator, when refused


Acceptance: TypeAlias = Generator[int, None, Verdict]
"""Stores a plan or refuses it, in steps: yields the work done, in the unit of PlanReview."""


NO_ANSWER: Final = Verdict(
    mavlink.MAV_MISSION_ERROR, reason="not saved: the medium does not answer"
)


class PlanStore:
    """Holds one kind of plan, as it was uploaded."""

    def __init__(
        self,
        mission_type: int,
        *,
        check: PlanCheck,
        publish: Callable[[Plan], None],
        storage: Storage | None = None,
    ) -> None:
        """Begin with no plan; without a storage none survives a restart."""
        self._check = check
        self._publish = publish
        self._storage = storage
        self._mission_type = mission_type
        self._file = FILE_NAMES[mission_type]
        self.items: tuple[StoredItem, ...] = ()
        self.plan_id = 0
        self.is_writing = False
        """Whether the medium has begun to take a plan, which no peer can give up any more."""
        self._writing_since_us: int | None = None
        self._is_too_slow = False
        self._now_us = 0
        self._restoring: Stepwise[None] | None = None

    @property
    def is_stuck(self) -> bool:
        """Whether a write that was given up, or its repair, has not ended: nothing is taken."""
        return self._restoring is not None

    def tick(self, now_us: int) -> None:
        """Look how long the medium takes, and repair what it has written too late."""
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
        """Publish what a former run has stored; gives a sentence when that cannot be used."""
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
        """Why an item can be no part of such a plan, wherever in it."""
        rejection = self._check.item(item_for_navigator(seq, item))
        return None if rejection is None else ItemFault(rejection.result, rejection.reason)

    def accept(self, items: Sequence[StoredItem], now_us: int) -> Acceptance:
        """Put a plan in the place of the former one, or refuse it and keep that one."""
        if self.is_stuck:
            return NO_ANSWER
        packing = len(items) // _PACKED_PER_UNIT
        for_flight = []
        for seq, item in enumerate(items):
            for_flight.append(item_for_navigator(seq, item))
            yield seq % _PACKED_PER_UNIT == 0
        plan = tuple(for_flight)
        rejection = (yield from self._check.plan(plan)) if plan else None
        if rejection is not None:
            return Verdict(rejection.result, reason=f"item {rejection.seq}: {rejection.reason}")
        identifier = plan_id(items)
        yield packing
        contents = plan_file.encode(self._mission_type, items) if items else None
        yield packing
        try:
            write = self._keep(contents)
            self.is_writing, self._writing_since_us, self._is_too_slow = True, None, False
            while not write.done():
                if self._is_too_slow:
                    self._restoring = Stepwise(self._restored(write))
                    return NO_ANSWER
                yield _UNTIL_NEXT_CALL
            write.result()
        except OSError as error:
            full = error.errno in _FULL
            result = mavlink.MAV_MISSION_NO_SPACE if full else mavlink.MAV_MISSION_ERROR
            return Verdict(result, reason=f"not saved: {error.strerror or error}")
        finally:
            self.is_writing = False
        self._replace(now_us, tuple(items), identifier, plan)
        return Verdict(ACCEPTED, identifier)

    def _restored(self, late: Write) -> Generator[int, None, None]:
        """Wait for a write that was given up; write the plan in force again if it ends well."""
        try:
            yield from _ended(late)
        except OSError:
            return  # The medium still holds the plan in force
        while True:
            contents = plan_file.encode(self._mission_type, self.items) if self.items else None
            yield _UNTIL_NEXT_CALL
            try:
                yield from _ended(self._keep(contents))
            except OSError:
                again_us = self._now_us + _RETRY_US
                while self._now_us < again_us:
                    yield _UNTIL_NEXT_CALL
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

    def _keep(self, contents: bytes | None) -> Write:
        if self._storage is None:
            return WRITTEN
        if contents is None:
            return self._storage.remove(self._file)  # works on a full medium too
        return self._storage.save(self._file, contents)

    def _read(self) -> tuple[StoredItem, ...]:
        contents = None if self._storage is None else self._storage.load(self._file)
        return () if contents is None else plan_file.decode(self._mission_type, contents)

    def _fault_of_stored(self, items: Sequence[StoredItem]) -> str:
        """Why a plan kept by a former run, maybe of another version, cannot be flown."""
        if len(items) > MAX_ITEMS:
            return f"it holds {len(items)} items, {MAX_ITEMS} fit"
        rejection = finished(self._check.plan(for_navigator(items))) if items else None
        return "" if rejection is None else f"item {rejection.seq}: {rejection.reason}"


def _ended(write: Write) -> Generator[int, None, None]:
    """Wait for a write, call by call.

    Raises:
        OSError: if the medium refuses it.
    """
    while not write.done():
        yield _UNTIL_NEXT_CALL
    write.result()
