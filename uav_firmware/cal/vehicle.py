"""What a vehicle's hardware offers the flight stack, whatever it is made of.

The scheduler calls, in each control step: `write_motors`, `advance`, then the `read_*`
methods. A reading that is not due in this step is None.
"""

from typing import NamedTuple, Protocol

from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorBattery,
    SensorEsc,
    SensorGps,
    SensorGround,
    SensorHygrometer,
    SensorImu,
    SensorMag,
    SensorRange,
    SensorTruth,
)
from uav_firmware.msg.vectors import Motors


class Actuators(Protocol):
    """Motors of a quadrotor."""

    def write_motors(self, control: Motors) -> None:
        """Command the motors, 0 stopped to 1 full, in PX4's quad-x order."""


class Fitted(NamedTuple):
    """How many instances of an instrument the vehicle has."""

    imus: int = 1
    barometers: int = 1
    compasses: int = 1


class Sensors(Protocol):
    """The vehicle's instruments; instances count from 0."""

    @property
    def fitted(self) -> Fitted:
        """How many there are; does not change."""

    @property
    def only_fast(self) -> bool:
        """Whether in this step nothing but inertial samples and the reports of ESCs can be due."""

    def read_imu(self, instance: int = 0) -> SensorImu:
        """Newest inertial sample of an instance; there is one in every step."""

    def read_baro(self, instance: int = 0) -> SensorBaro | None:
        """Barometer sample of an instance if one is due."""

    def read_mag(self, instance: int = 0) -> SensorMag | None:
        """Magnetometer sample of an instance if one is due."""

    def read_gps(self) -> SensorGps | None:
        """GNSS fix if one has arrived."""

    def read_battery(self) -> SensorBattery | None:
        """Battery sample if one is due."""

    def read_esc(self) -> SensorEsc | None:
        """Report of the motors' speed controllers if one is due."""

    def read_range(self) -> SensorRange | None:
        """Sample of the range finder if there is one, and a sample is due."""

    def read_hygrometer(self) -> SensorHygrometer | None:
        """Sample of the air if there is an instrument for it, and a sample is due."""

    def read_ground(self) -> SensorGround | None:
        """Sample of soil and light if there are instruments for them, and one is due."""

    def read_truth(self) -> SensorTruth | None:
        """True state where the vehicle is simulated, else None."""


class Vehicle(Actuators, Sensors, Protocol):
    """A whole vehicle with its own clock."""

    @property
    def time_us(self) -> int:
        """Time since boot [us]; the only clock of the flight stack."""

    @property
    def step_us(self) -> int:
        """Length of a control step [us]."""

    def advance(self) -> None:
        """Advance by one control step: physics in a simulation, a timer on hardware."""

    def close(self) -> None:
        """Release files and devices."""
