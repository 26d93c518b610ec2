"""What a person can do in the vehicle's place."""

from dataclasses import dataclass
from enum import Enum, auto
from typing import NamedTuple, TypeAlias

from sim.tester.vehicle.alarms import Alarm


class Pose(NamedTuple):
    """Where the vehicle is and how it lies."""

    latitude_deg: float
    longitude_deg: float
    relative_altitude_m: float  # Above home
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0


class ObservationPart(Enum):
    """What of the observation can be changed."""

    RESOURCE_ID = auto()
    OBSERVED_PROPERTY = auto()
    RESULT_VALUE = auto()
    RESULT_UOM = auto()


@dataclass(frozen=True, slots=True)
class FinishCommand:
    """The running command is finished."""


@dataclass(frozen=True, slots=True)
class SetPose:
    """The vehicle is there now."""

    pose: Pose


@dataclass(frozen=True, slots=True)
class SetAlarm:
    """Something has failed; the two numbers say more about it."""

    alarm: Alarm
    parameters: tuple[float, float]


@dataclass(frozen=True, slots=True)
class SetBatteryCapacity:
    """The battery holds so much."""

    capacity_mah: float


@dataclass(frozen=True, slots=True)
class SetBatteryPercentage:
    """So much of the battery is left."""

    percentage: int


@dataclass(frozen=True, slots=True)
class SetObservation:
    """One part of what is observed."""

    part: ObservationPart
    value: str | float


@dataclass(frozen=True, slots=True)
class Land:
    """The vehicle is down after an abort or an alarm."""


Action: TypeAlias = (
    FinishCommand
    | SetPose
    | SetAlarm
    | SetBatteryCapacity
    | SetBatteryPercentage
    | SetObservation
    | Land
)
