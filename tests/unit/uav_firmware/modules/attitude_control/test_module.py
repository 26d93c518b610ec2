from uav_firmware.bus import Topic
from uav_firmware.lib.rotation import from_euler
from uav_firmware.modules.attitude_control.module import AttitudeControlModule
from uav_firmware.modules.attitude_control.params import AttitudeControlParams
from uav_firmware.msg.estimate import VehicleAttitude
from uav_firmware.msg.setpoints import VehicleAttitudeSetpoint, VehicleRatesSetpoint
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

LEVEL = (1.0, 0.0, 0.0, 0.0)


class Vehicle:
    """The attitude controller with its topics."""

    def __init__(self) -> None:
        self.registry = Registry()
        self.registry.add(AttitudeControlParams)
        self.attitude: Topic[VehicleAttitude] = Topic()
        self.wanted: Topic[VehicleAttitudeSetpoint] = Topic()
        self.rates: Topic[VehicleRatesSetpoint] = Topic()
        self.module = AttitudeControlModule(
            attitude=self.attitude,
            attitude_setpoint=self.wanted,
            rates_setpoint=self.rates,
            registry=self.registry,
        )

    def rate_for(self, roll: float, thrust: float) -> Vector3:
        self.attitude.publish(VehicleAttitude(5, LEVEL, (0.0, 0.0, 0.0)))
        self.wanted.publish(VehicleAttitudeSetpoint(5, from_euler(roll, 0.0, 0.0), 0.0, thrust))
        self.module.update()
        assert self.rates.value is not None
        assert self.rates.value.thrust == thrust
        return self.rates.value.rate_frd


def test_nothing_is_asked_for_before_there_is_an_attitude() -> None:
    vehicle = Vehicle()
    vehicle.module.update()
    assert vehicle.rates.value is None


def test_a_wanted_roll_becomes_a_roll_rate() -> None:
    assert Vehicle().rate_for(0.2, 0.3)[0] > 0.0


def test_without_thrust_no_rate_is_asked_for() -> None:
    assert Vehicle().rate_for(0.2, 0.0) == (0.0, 0.0, 0.0)


def test_a_changed_gain_is_taken_in_flight() -> None:
    vehicle = Vehicle()
    before = vehicle.rate_for(0.1, 0.3)
    vehicle.registry.set("MC_ROLL_P", 3.25)
    assert vehicle.rate_for(0.1, 0.3)[0] < 0.6 * before[0]
