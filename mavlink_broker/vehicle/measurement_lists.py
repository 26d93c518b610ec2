"""The newest measurements of one vehicle's environment, and the lists that are posted of them.

A measurement keeps the place and the time at which it was made. One that is older than a few
seconds belongs to another place and is not posted.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from afarcloud.state import Observation, ObservationList
from mavlink_broker.autopilots.tunnel_messages import tunnel_observation
from mavlink_broker.mavlink.dialect import Message, source_of
from mavlink_broker.vehicle.measurements import Quantity, Reading, readings
from mavlink_broker.vehicle.telemetry import Position, Snapshot

FRESH_S: Final = 5.0
"""By the vehicle's clock."""
RECEIVED_WITHIN_S: Final = 30.0
"""By the broker's: after a lost link the vehicle's clock is as old as the rest."""
SOURCES_KEPT: Final = 64
"""Limits the memory that new names of a vehicle can fill."""
LIST_LENGTH: Final = 10
"""Limit of AFarCloud's ObservationList; more observations make another list."""


class ResourceKey(NamedTuple):
    """What stays the same about a measurement: component, sensor and property."""

    component: int
    sensor: str
    observed_property: str
    own_name: str = ""  # Where it has sent its own resource id


class _Measured(NamedTuple):
    value: float
    quantity: Quantity
    place: Position
    vehicle_s: float | None  # By the autopilot's clock, since it was switched on
    received_at: float  # By the broker's


def resource_id(vehicle_id: int, key: ResourceKey) -> str:
    """Name a sensor as AFarCloud does: a URN of five parts, unless it has a name of its own."""
    if key.own_name:
        return key.own_name
    return f"urn:afc:uav:{vehicle_id}:{key.component}:{key.sensor}:{key.observed_property}"


@dataclass(slots=True)
class Observations:
    """What one vehicle has measured lately."""

    _newest: dict[ResourceKey, _Measured] = field(default_factory=dict)

    def take(self, message: Message, snapshot: Snapshot, now: float) -> None:
        """Keep the measurements of a message, with the vehicle's present position."""
        for reading, own_name in _readings_with_names(message):
            observed_property = reading.quantity.observed_property
            component = source_of(message).component
            key = ResourceKey(component, reading.sensor, observed_property, own_name)
            if reading.value is None or snapshot.position is None:
                self._newest.pop(key, None)
            elif key in self._newest or len(self._newest) < SOURCES_KEPT:
                self._newest[key] = _Measured(
                    reading.value, reading.quantity, snapshot.position, snapshot.time_s, now
                )

    def forget(self) -> None:
        """Drop everything: the vehicle was restarted."""
        self._newest.clear()

    def lists(
        self, snapshot: Snapshot, now: float, *, vehicle_id: int, sequence_number: int
    ) -> Iterator[ObservationList]:
        """Give what is fresh, ten to a list, each list at the place of its newest measurement.

        A `result_time` of 0 stands for a vehicle that has sent no time of day.
        """
        fresh = sorted(
            (key, measured)
            for key, measured in self._newest.items()
            if _is_fresh(measured, snapshot, now)
        )
        for number, first in enumerate(range(0, len(fresh), LIST_LENGTH)):
            batch = fresh[first : first + LIST_LENGTH]
            place = max(batch, key=lambda pair: pair[1].received_at)[1].place
            yield ObservationList(
                sequence_number=sequence_number + number,
                vehicle_id=vehicle_id,
                latitude=place.latitude_deg,
                longitude=place.longitude_deg,
                altitude=place.altitude_m,
                observation_array=tuple(
                    _observation(vehicle_id, key, measured, snapshot) for key, measured in batch
                ),
            )


def _readings_with_names(message: Message) -> Iterator[tuple[Reading, str]]:
    """Give the readings of a message, each with the resource id that came with it, if any."""
    for reading in readings(message):
        yield reading, ""
    own = tunnel_observation(message)
    if own is not None:
        yield Reading("", Quantity(own.observed_property, own.unit), own.value), own.resource_id


def _is_fresh(measured: _Measured, snapshot: Snapshot, now: float) -> bool:
    if now - measured.received_at > RECEIVED_WITHIN_S:
        return False
    if snapshot.time_s is None or measured.vehicle_s is None:
        return now - measured.received_at <= FRESH_S
    return snapshot.time_s - measured.vehicle_s <= FRESH_S


def _observation(
    vehicle_id: int, key: ResourceKey, measured: _Measured, snapshot: Snapshot
) -> Observation:
    return Observation(
        resource_id=resource_id(vehicle_id, key),
        observed_property=measured.quantity.observed_property,
        result_time=_time_of_day_s(measured, snapshot),
        result_value=measured.value,
        result_uom=measured.quantity.unit,
    )


def _time_of_day_s(measured: _Measured, snapshot: Snapshot) -> int:
    if snapshot.booted_at_utc_s is None or measured.vehicle_s is None:
        return 0
    return round(snapshot.booted_at_utc_s + measured.vehicle_s)
