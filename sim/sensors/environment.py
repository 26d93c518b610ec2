"""What the vehicle measures of the air and the soil below it, once a second.

| instrument | measures | one sigma |
|---|---|---|
| hygrometer, of the Sensirion SHT45's class | air temperature, relative humidity | 0.1 K, 1 % |
| L-band radiometer, without contact | water in the upper soil | 0.01 m^3/m^3 |
| infrared thermometer | temperature of the soil's surface layer | 0.5 K |
| light sensor | light on level ground | 3 % |

The radiometer and the thermometer look straight down; what they see is the map at the vehicle's
own place. Slow offsets are left out: within a flight they cannot be distinguished from the place.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from sim.physics.noise import standard_normals
from sim.physics.truth import Truth
from sim.sensors.readings import EnvironmentReading
from sim.world.farm import Farm

RATE_HZ: Final = 1
AIR_SIGMA_C: Final = 0.1
HUMIDITY_SIGMA_PERCENT: Final = 1.0
SOIL_MOISTURE_SIGMA: Final = 0.01
SOIL_SIGMA_C: Final = 0.5
LIGHT_SIGMA: Final = 0.03


class EnvironmentSensors:
    """All of them; `factor` scales every error alike."""

    def __init__(self, generator: np.random.Generator, farm: Farm, *, factor: float) -> None:
        self._normals: Iterator[float] = standard_normals(generator)
        self._farm = farm
        self._factor = factor

    def read(self, truth: Truth, farm_time_s: float) -> EnvironmentReading:
        """One sample of each, at the vehicle's true place and at a time on the farm."""
        farm, place = self._farm, (truth.latitude_deg, truth.longitude_deg, farm_time_s)
        height_m = max(truth.height_above_home_m, 0.0)
        humidity = farm.relative_humidity(*place, height_m) + self._error(HUMIDITY_SIGMA_PERCENT)
        moisture = farm.soil_moisture(*place) + self._error(SOIL_MOISTURE_SIGMA)
        return EnvironmentReading(
            time_us=truth.time_us,
            air_temperature_c=farm.air_temperature(*place, height_m) + self._error(AIR_SIGMA_C),
            relative_humidity_percent=min(max(humidity, 0.0), 100.0),
            soil_moisture=min(max(moisture, 0.0), 1.0),
            soil_temperature_c=farm.soil_temperature(*place) + self._error(SOIL_SIGMA_C),
            illuminance_lx=farm.illuminance(*place) * (1.0 + self._error(LIGHT_SIGMA)),
        )

    def _error(self, sigma: float) -> float:
        return self._factor * sigma * next(self._normals)
