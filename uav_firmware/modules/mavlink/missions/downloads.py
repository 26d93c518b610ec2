"""Which plan each peer downloads, so that no download holds items of two plans.

A download begins with the count of the items and ends with MISSION_ACK. Its items belong to the
plan that was counted; once another one is in force, the rest of them is refused.
"""

from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

from uav_firmware.cal.link import Address

SILENT_US: Final = 15_000_000
"""A download without a request for this time has ended."""
_MAX_DOWNLOADS: Final = 32


@dataclass(slots=True)
class _Download:
    """One download of one peer."""

    plan_id: int
    asked_us: int
    refused: bool = False


class Downloads:
    """The downloads in progress."""

    def __init__(self) -> None:
        self._downloads: OrderedDict[tuple[Address, int], _Download] = OrderedDict()

    def begin(self, address: Address, mission_type: int, plan_id: int, now_us: int) -> None:
        """Note the plan whose number of items has been sent to a peer."""
        key = (address, mission_type)
        self._downloads[key] = _Download(plan_id, now_us)
        self._downloads.move_to_end(key)
        if len(self._downloads) > _MAX_DOWNLOADS:
            self._downloads.popitem(last=False)

    def end(self, address: Address, mission_type: int) -> None:
        """Forget a download."""
        self._downloads.pop((address, mission_type), None)

    def is_of_another_plan(
        self, address: Address, mission_type: int, plan_id: int, now_us: int
    ) -> bool:
        """Whether an item of the plan in force does not belong to the download of a peer."""
        download = self._downloads.get((address, mission_type))
        if download is None:
            return False
        if now_us - download.asked_us > SILENT_US:
            self.end(address, mission_type)
            return False
        download.asked_us = now_us
        return download.plan_id != plan_id

    def note_refusal(self, address: Address, mission_type: int) -> bool:
        """Note that a request was refused; whether it is the first one of its download."""
        download = self._downloads[address, mission_type]
        is_first, download.refused = not download.refused, True
        return is_first
