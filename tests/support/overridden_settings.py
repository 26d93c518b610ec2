"""A plan that overrides every setting of a vehicle that the broker may change and has to restore.

Geofence, rally points, the parameters that guard the fence and those that a command needs.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.support.broker_world import World, circle, follow, go_home, mission, takeoff
from tests.support.fenced_vehicle import (
    ARDUPILOT_VALUES,
    PX4_VALUES,
    RALLY,
    FencedVehicle,
    fenced_vehicle,
)
from tests.support.geofences import RALLY_POINT, fence, placed, square
from tests.support.scripted_disk import DISK_LAG_S
from tests.support.vehicle_script import PX4, Script

WITH_RATE: dict[str, Any] = ARDUPILOT_VALUES | {"CIRCLE_RATE": 20.0, "CIRCLE_OPTIONS": 1.0}
WITH_FOLLOW: dict[str, Any] = PX4_VALUES | {
    "FLW_TGT_HT": 8.0,
    "FLW_TGT_DST": 8.0,
    "FLW_TGT_FA": 180.0,
    "FLW_TGT_ALT_M": 0.0,
}
"""Parameters of a vehicle, also those that a circle or following a target needs."""


class Farm:
    """A vehicle with an operator's fence and values, and a plan that changes them all."""

    def __init__(
        self,
        folder: Path,
        script: Script,
        values: Mapping[str, Any],
        uid: int = 0,
        **more: Any,
    ) -> None:
        self.world = World(journal=folder, disk_lag_s=DISK_LAG_S, **more)
        self.folder = folder
        self.vehicle: FencedVehicle = fenced_vehicle(self.world, script, values=values)
        self.vehicle.uid = uid
        placed(self.vehicle, square(half_m=90.0))
        self.before = self.held
        self.world.run(2.0)
        part = follow(altitude=12.0) if script is PX4 else circle()
        self.world.edge.plan(
            mission(takeoff(), part, go_home(3)),
            geofence=fence(max_altitude=60.0),
            rally_points=[RALLY_POINT],
        )

    @property
    def held(self) -> tuple[Any, ...]:
        """Everything that a plan may change."""
        rally = [(item.x, item.y, item.z) for item in self.vehicle.plans[RALLY].items]
        return self.vehicle.fence, rally, dict(self.vehicle.values)

    def is_as_before(self) -> bool:
        """Whether the operator finds everything as it was, and nothing more is noted."""
        return self.held == self.before and not list(self.folder.iterdir())
