"""Tells a vehicle that follows where its target is, as often as it tells its own position."""

import math
from typing import Final

from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.planning.follow_target import target_message
from mavlink_broker.planning.situation import Spot
from mavlink_broker.vehicle.vehicle import Vehicle

TARGET_EVERY_S: Final = 0.2
"""As often as positions come, with one of which it is told."""
TARGET_SLACK_S: Final = 0.05


class TargetTeller:
    """The target of one live command, at the height of its place."""

    def __init__(self, spot: Spot | None, vehicle: Vehicle) -> None:
        self._spot = spot
        self._vehicle = vehicle
        self._due_at_s = -math.inf

    def tell(self, time_s: float, followed_s: float, now: float) -> list[Message]:
        """Tell it when it is time, by the vehicle's clock; it has been followed for so long."""
        spot, home = self._spot, self._vehicle.snapshot.home
        if spot is None or home is None or time_s < self._due_at_s:
            return []
        self._due_at_s = time_s + TARGET_EVERY_S - TARGET_SLACK_S
        lead = self._vehicle.lead
        if lead is None:
            return [target_message(spot, home, now)]
        seen = lead.at(followed_s, now)
        if seen is None:
            return []  # The vehicle holds by itself until somebody is seen again
        there = spot._replace(latitude_deg=seen.latitude_deg, longitude_deg=seen.longitude_deg)
        return [target_message(there, home, now, velocity_ned_m_s=seen.velocity_ned_m_s)]
