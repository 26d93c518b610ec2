"""The simulated F450 as a vehicle of the component abstraction layer.

Only the `jsbsim` drivers import the simulator.
Frames and units are the same on both sides (NED, FRD, SI); what changes here is the type.
"""

from typing import Final

from sim.fault_schedule import FaultError
from sim.faults.console import FaultConsole
from sim.faults.injection import Failure, Unit, faults_of, kinds_of
from sim.faults.notation import Clear, read_order
from sim.sensors import rangefinder
from sim.sensors.readings import Readings
from sim.simulation import Simulation
from uav_firmware.cal.vehicle import Fitted
from uav_firmware.drivers.jsbsim_camera import JsbsimCamera
from uav_firmware.drivers.jsbsim_seeker import JsbsimSeeker
from uav_firmware.drivers.jsbsim_video import JsbsimRecorder, JsbsimStreamer
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

_STOPPED: Motors = (0.0, 0.0, 0.0, 0.0)
_FAULT_CONSOLE_PERIOD_US: Final = 100_000


class JsbsimVehicle:
    """Implements `Vehicle`, `FaultInjector` and `CameraCarrier` of `uav_firmware.cal`.

    With a console it also takes orders to break and to mend parts from a file.
    """

    def __init__(
        self,
        simulation: Simulation,
        console: FaultConsole | None = None,
        camera: JsbsimCamera | None = None,
        recorder: JsbsimRecorder | None = None,
        streamer: JsbsimStreamer | None = None,
    ) -> None:
        self._simulation = simulation
        self.camera = camera
        """The camera; None on a vehicle without one."""
        self.recorder = recorder
        """What records the camera's films; None where nothing does."""
        self.streamer = streamer
        """What shows live what the camera sees; None where nothing does."""
        self.seeker = JsbsimSeeker(simulation)
        """What finds moving things in the camera's picture."""
        self._console = console
        self._console_us = 0
        self._motors = _STOPPED
        self._readings: Readings = simulation.readings
        self.time_us = simulation.time_us
        """Simulated time since boot [us]."""
        self.only_fast = self._readings.only_fast
        """Whether no instrument but inertial units and speed controllers has a reading."""

    @property
    def step_us(self) -> int:
        """Length of a control step [us]."""
        return self._simulation.config.step_us

    def write_motors(self, control: Motors) -> None:
        """Command the motors from the next step on, 0 stopped to 1 full."""
        self._motors = control

    def advance(self) -> None:
        """Advance by one control step.

        Raises:
            ValueError: when a motor command is not a finite number; time does not advance then.
            OSError: if the file of fault commands cannot be read any more.
        """
        self._readings = readings = self._simulation.step(self._motors)
        self.time_us, self.only_fast = readings.imus[0].time_us, readings.only_fast
        if self._console is not None and self.time_us >= self._console_us:
            self._console_us = self.time_us + _FAULT_CONSOLE_PERIOD_US
            self._obey(self._console)

    @property
    def fitted(self) -> Fitted:
        """How many inertial units, barometers and compasses there are."""
        config = self._simulation.config
        return Fitted(config.imus, config.barometers, config.compasses)

    def read_imu(self, instance: int = 0) -> SensorImu:
        """Inertial sample of this step."""
        imu = self._readings.imus[instance]
        return SensorImu(imu.time_us, imu.rate_frd, imu.specific_force_frd)

    def read_baro(self, instance: int = 0) -> SensorBaro | None:
        """Barometer sample if one is due."""
        baro = self._readings.baros[instance]
        if baro is None:
            return None
        return SensorBaro(baro.time_us, baro.pressure_pa, baro.temperature_c)

    def read_mag(self, instance: int = 0) -> SensorMag | None:
        """Magnetometer sample if one is due."""
        mag = self._readings.mags[instance]
        return None if mag is None else SensorMag(mag.time_us, mag.field_frd_gauss)

    def read_gps(self) -> SensorGps | None:
        """GNSS solution if one has arrived."""
        gps = self._readings.gps
        if gps is None:
            return None
        return SensorGps(
            time_us=gps.time_us,
            time_utc_us=gps.time_utc_us,
            latitude_deg=gps.latitude_deg,
            longitude_deg=gps.longitude_deg,
            altitude_amsl_m=gps.altitude_amsl_m,
            velocity_ned=gps.velocity_ned,
            horizontal_accuracy_m=gps.horizontal_accuracy_m,
            vertical_accuracy_m=gps.vertical_accuracy_m,
            speed_accuracy_m_s=gps.speed_accuracy_m_s,
            fix_type=gps.fix_type,
            satellites_used=gps.satellites_used,
            hdop=gps.hdop,
            vdop=gps.vdop,
            altitude_ellipsoid_m=gps.altitude_amsl_m + gps.geoid_height_m,
        )

    def read_battery(self) -> SensorBattery | None:
        """Battery sample if one is due."""
        battery = self._readings.battery
        if battery is None:
            return None
        return SensorBattery(
            time_us=battery.time_us,
            voltage_v=battery.voltage_v,
            current_a=battery.current_a,
        )

    def read_esc(self) -> SensorEsc | None:
        """Report of the speed controllers if one is due."""
        esc = self._readings.esc
        return None if esc is None else SensorEsc(esc.time_us, esc.rotor_rpm, esc.current_a)

    def read_range(self) -> SensorRange | None:
        """Sample of the range finder if one is due."""
        sample = self._readings.range
        if sample is None:
            return None
        return SensorRange(
            sample.time_us, sample.distance_m, rangefinder.MINIMUM_M, rangefinder.MAXIMUM_M
        )

    def read_hygrometer(self) -> SensorHygrometer | None:
        """Sample of the air if one is due."""
        sample = self._readings.environment
        if sample is None or not sample.hygrometer_speaks:
            return None
        return SensorHygrometer(
            sample.time_us, sample.air_temperature_c, sample.relative_humidity_percent
        )

    def read_ground(self) -> SensorGround | None:
        """Sample of soil and light if one is due."""
        sample = self._readings.environment
        if sample is None:
            return None
        return SensorGround(
            sample.time_us,
            sample.soil_moisture,
            sample.soil_temperature_c,
            sample.illuminance_lx,
        )

    def read_truth(self) -> SensorTruth:
        """True state, for display and never for control."""
        truth = self._simulation.truth
        return SensorTruth(
            time_us=truth.time_us,
            latitude_deg=truth.latitude_deg,
            longitude_deg=truth.longitude_deg,
            altitude_amsl_m=truth.altitude_amsl_m,
            velocity_ned=truth.velocity_ned,
            q_ned_frd=truth.q_ned_frd,
            rate_frd=truth.rate_frd,
            acceleration_frd=truth.specific_force_frd,
            airspeed_m_s=truth.airspeed_m_s,
        )

    @property
    def link_lost(self) -> bool:
        """Whether a fault interrupts the link to the peers."""
        return self._simulation.link_lost

    def inject(self, unit: int, failure_type: int, instance: int) -> bool:
        """Inject or clear a failure; False for an unknown unit or failure."""
        simulation = self._simulation
        if failure_type == Failure.OK:
            return self._mend(unit, instance)
        faults = faults_of(unit, failure_type, instance, simulation.time_us)
        if faults is None:
            return False
        for fault in faults:
            simulation.add_fault(fault)
        return True

    def _mend(self, unit: int, instance: int) -> bool:
        kinds = kinds_of(unit)
        motor = instance if unit == Unit.MOTOR and instance != 0 else None
        for kind in kinds:
            self._simulation.clear_faults(kind, motor)
        return bool(kinds)

    def _obey(self, console: FaultConsole) -> None:
        """Carry out the lines received, and report the results."""
        simulation = self._simulation
        for line in console.poll():
            try:
                order = read_order(line, simulation.time_us)
            except FaultError as error:
                console.note(simulation.time_us, f"refused: {line}: {error}")
                continue
            if isinstance(order, Clear):
                simulation.clear_faults(order.kind, order.motor, order.instance)
            else:
                simulation.add_fault(order)
            console.note(simulation.time_us, f"accepted: {line}")
        console.note_active(simulation.time_us, simulation.faults)

    def close(self) -> None:
        """Close the truth log and the console."""
        self._simulation.close()
        if self._console is not None:
            self._console.close()
        for part in (self.camera, self.recorder, self.streamer):
            if part is not None:
                part.close()
