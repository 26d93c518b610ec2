"""What is told of a vehicle whether or not it flies a mission: that it is there, and its state."""

from typing import Any, Final

from mavlink_broker.effects import Effects, VehicleUpdate
from mavlink_broker.vehicle import registration
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.state_vector_schedule import VectorPace
from mavlink_broker.vehicle.vehicle import Vehicle

UPDATE_EVERY_S: Final = 2.0
UPDATE_LOST_EVERY_S: Final = 30.0
"""Of a vehicle that says nothing there is no news."""
_PLACED: Final = frozenset({"position", "attitude"})
"""What a state vector must not be without."""


class Bulletin:
    """The regular news of one vehicle."""

    def __init__(
        self,
        vehicle: Vehicle,
        reporter: Reporter,
        *,
        state_vector_every_s: float,
        observations_every_s: float,
    ) -> None:
        """Take how often; observations every 0 s come with finished commands alone."""
        self._vehicle = vehicle
        self._reporter = reporter
        self._pace = VectorPace(state_vector_every_s)
        self._observations_every_s = observations_every_s
        self._observed_at = 0.0
        self._updated_at: float | None = None
        self._last_update: tuple[Any, ...] = ()

    def update(self, mission_id: int | None, now: float, effects: Effects) -> None:
        """Tell the edge server about the vehicle: on a change, and every so often."""
        vehicle = self._vehicle
        change = (
            *(vehicle.link_state(now), vehicle.snapshot.armed, vehicle.mode, mission_id),
            *(vehicle.warning, registration.stale(vehicle, now)),
        )
        every_s = UPDATE_EVERY_S if vehicle.is_heard(now) else UPDATE_LOST_EVERY_S
        due = self._updated_at is None or now - self._updated_at >= every_s
        if not due and change == self._last_update:
            return
        self._updated_at, self._last_update = now, change
        body = registration.description(vehicle, mission_id, now)
        effects.for_edge.append(VehicleUpdate(vehicle.vehicle_id, body))

    def tell_state(self, now: float, effects: Effects) -> bool:
        """Tell the state at once; false when it is not known."""
        vector = self._reporter.state_vector()
        if vector is None or not _PLACED.isdisjoint(registration.stale(self._vehicle, now)):
            return False
        effects.for_edge.append(vector)
        self._pace.told(now)
        return True

    def step(self, now: float, effects: Effects) -> None:
        """Tell what is due of a vehicle that is heard well."""
        if not self._vehicle.is_connected(now):
            return
        if self._pace.is_due(now, self._vehicle.age_s("GLOBAL_POSITION_INT", now)):
            self.tell_state(now, effects)
        every_s = self._observations_every_s
        due = every_s > 0 and now - self._observed_at >= every_s
        if due and self._vehicle.snapshot.armed:
            self._observed_at = now
            effects.for_edge += self._reporter.observations(now)
