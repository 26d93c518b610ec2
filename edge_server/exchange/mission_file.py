"""The content of a mission file of any format."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from afarcloud.faults import Fault
from edge_server.exchange.mission_item import Home, Item


class MissionFile(NamedTuple):
    """A mission before it is translated."""

    items: list[Item]
    home: Home | None
    speed_m_s: float | None = None  # Where no item has one
    zero_yaw_is_unset: bool = False
    geofence: dict[str, Any] | None = None
    rally_points: Sequence[Mapping[str, Any]] = ()
    warnings: tuple[Fault, ...] = ()
    missing: tuple[Fault, ...] = ()  # Parts that the file names and does not carry
