"""A source that disagrees with the others is stopped; only what nothing holds is reset."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from tests.unit.uav_firmware.modules.estimator.flight import LONGEST_S, Readings, Rig, recorded
from uav_firmware.modules.estimator.health import StatusFlag
from uav_firmware.msg.estimate import AidSource
from uav_firmware.msg.sensors import SensorGps

Change = Callable[[Readings], Readings]
JUMP_S = 20.0
NONE = AidSource(0)
METRE_DEG = 1.0 / 111_000.0


class Trial:
    """A flight that can be spoilt from a time on, judged against its truth."""

    def __init__(self, seed: int = 1, *, start_s: float = 12.0, **parameters: float) -> None:
        self.rig = Rig(**parameters)
        self._steps = recorded(seed, start_s=start_s).steps(LONGEST_S)
        self.change: Change = lambda readings: readings
        self.worst_down_m = 0.0
        self.worst_horizontal_m = 0.0

    def fly_until(self, time_s: float) -> "Trial":
        for readings in self._steps:
            self.rig.feed(self.change(readings))
            if readings.truth.time_us >= JUMP_S * 1e6:
                north, east, down = self.rig.position_error(readings.truth)
                self.worst_horizontal_m = max(self.worst_horizontal_m, math.hypot(north, east))
                self.worst_down_m = max(self.worst_down_m, abs(down))
            if readings.truth.time_us >= time_s * 1e6:
                self.truth = readings.truth
                break
        return self

    def spoil(self, change: Change) -> "Trial":
        self.change = change
        return self

    @property
    def stopped(self) -> AidSource:
        assert self.rig.status.value is not None
        return self.rig.status.value.stopped

    def glitch(self) -> bool:
        assert self.rig.status.value is not None
        return bool(self.rig.status.value.flags & StatusFlag.GPS_GLITCH)

    @property
    def baro_bias_m(self) -> float:
        core = self.rig.module.estimator.core
        assert core is not None
        return core.state.baro_bias_m


def on_gps(change: Callable[[SensorGps], SensorGps]) -> Change:
    def changed(readings: Readings) -> Readings:
        return readings if readings.gps is None else readings._replace(gps=change(readings.gps))

    return changed


def jump(*, north_m: float = 0.0, up_m: float = 0.0) -> Change:
    return on_gps(
        lambda gps: gps._replace(
            latitude_deg=gps.latitude_deg + north_m * METRE_DEG,
            altitude_amsl_m=gps.altitude_amsl_m + up_m,
        )
    )


def faster(*step_ned: float) -> Change:
    def change(gps: SensorGps) -> SensorGps:
        x, y, z = (a + b for a, b in zip(gps.velocity_ned, step_ned, strict=True))
        return gps._replace(velocity_ned=(x, y, z))

    return on_gps(change)


def both(*changes: Change) -> Change:
    def changed(readings: Readings) -> Readings:
        for change in changes:
            readings = change(readings)
        return readings

    return changed


def frozen_baro() -> Change:
    held: list[float] = []

    def change(readings: Readings) -> Readings:
        if readings.baro is None:
            return readings
        held.append(readings.baro.pressure_pa)
        return readings._replace(baro=readings.baro._replace(pressure_pa=held[0]))

    return change


def higher_baro(readings: Readings) -> Readings:
    baro = readings.baro
    if baro is None:
        return readings
    return readings._replace(baro=baro._replace(pressure_pa=baro.pressure_pa - 300.0))


def good(readings: Readings) -> Readings:
    return readings


@pytest.mark.first_case
@pytest.mark.parametrize("north_m", [20.0, -100.0])
def test_a_gps_position_that_jumps_is_stopped_until_it_is_back(north_m: float) -> None:
    trial = Trial().fly_until(JUMP_S)
    before = trial.rig.position.resets.number
    trial.spoil(jump(north_m=north_m)).fly_until(45.0)
    assert trial.stopped == AidSource.GPS_POSITION
    assert trial.glitch()
    assert trial.rig.position.position_valid
    assert trial.worst_horizontal_m < 1.0
    trial.spoil(good).fly_until(49.0)
    assert trial.stopped == NONE
    assert not trial.glitch()
    assert trial.worst_horizontal_m < 1.0
    assert trial.rig.position.resets.number == before


@pytest.mark.thorough
def test_gps_mode_0_believes_a_position_that_has_jumped_for_long() -> None:
    trial = Trial(EKF2_GPS_MODE=0).fly_until(JUMP_S)
    before = trial.rig.position.resets.number
    trial.spoil(jump(north_m=30.0)).fly_until(40.0)
    assert trial.worst_horizontal_m > 25.0
    assert trial.rig.position.resets.number > before
    assert trial.stopped == NONE


def rough(readings: Readings) -> Readings:
    """Fixes that report themselves as not good enough."""
    return on_gps(lambda gps: gps._replace(horizontal_accuracy_m=4.0, satellites_used=5))(readings)


@pytest.mark.first_case
@pytest.mark.parametrize(("checks", "used"), [(29, False), (24, True), (25, False), (28, False)])
def test_a_fix_is_refused_for_what_is_checked_alone(checks: int, *, used: bool) -> None:
    trial = Trial(EKF2_GPS_CHECK=checks).fly_until(JUMP_S)
    trial.spoil(rough).fly_until(34.0)
    assert trial.rig.position.dead_reckoning is not used


def coming_and_going(change: Change, *, bad_s: float, good_s: float) -> Change:
    def changed(readings: Readings) -> Readings:
        bad = (readings.truth.time_us * 1e-6) % (bad_s + good_s) < bad_s
        return change(readings) if bad else readings

    return changed


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("bad_s", "good_s", "found"), [(3.0, 1.5, AidSource.GPS_POSITION), (0.5, 4.0, NONE)]
)
def test_a_gps_position_that_comes_and_goes_is_stopped_if_it_is_wrong_often(
    bad_s: float, good_s: float, found: AidSource
) -> None:
    trial = Trial().fly_until(JUMP_S)
    trial.spoil(coming_and_going(jump(north_m=30.0), bad_s=bad_s, good_s=good_s)).fly_until(48.0)
    assert trial.stopped == found
    assert trial.worst_horizontal_m < 1.0
    trial.spoil(good).fly_until(52.0)
    assert trial.stopped == NONE


@pytest.mark.first_case
@pytest.mark.parametrize("up_m", [8.0, 30.0, -8.0, -30.0])
def test_a_gps_height_that_jumps_is_stopped_and_moves_no_barometer(up_m: float) -> None:
    trial = Trial().fly_until(JUMP_S)
    bias_m = trial.baro_bias_m
    trial.spoil(jump(up_m=up_m)).fly_until(40.0)
    assert trial.stopped == AidSource.GPS_HEIGHT
    assert trial.worst_down_m < 0.8
    assert trial.baro_bias_m == pytest.approx(bias_m, abs=0.5)
    assert trial.rig.position.resets.z_count == 0


@pytest.mark.thorough
def test_a_gps_velocity_that_jumps_is_stopped() -> None:
    trial = Trial().fly_until(JUMP_S).spoil(faster(5.0, 0.0, 0.0)).fly_until(40.0)
    assert trial.stopped == AidSource.GPS_VELOCITY
    assert np.abs(trial.rig.velocity_error(trial.truth)).max() < 0.5
    assert trial.worst_horizontal_m < 1.0


@pytest.mark.thorough
def test_a_barometer_that_jumps_is_stopped() -> None:
    trial = Trial().fly_until(JUMP_S).spoil(higher_baro).fly_until(40.0)
    assert trial.stopped == AidSource.BAROMETER
    assert trial.worst_down_m < 0.8


@pytest.mark.thorough
def test_vertical_velocity_holds_a_height_whose_sources_have_both_failed() -> None:
    trial = Trial().fly_until(JUMP_S)
    trial.spoil(both(frozen_baro(), jump(up_m=30.0))).fly_until(50.0)
    assert trial.stopped == AidSource.GPS_HEIGHT | AidSource.BAROMETER
    assert trial.rig.position.altitude_valid
    assert trial.worst_down_m < 1.5
    assert trial.rig.position.resets.z_count == 0


@pytest.mark.thorough
def test_what_nothing_holds_is_reset_and_the_step_is_published() -> None:
    trial = Trial().fly_until(JUMP_S)
    trial.spoil(both(frozen_baro(), jump(north_m=50.0, up_m=30.0), faster(6.0, 0.0, 3.0)))
    trial.fly_until(24.0)
    before = trial.rig.position
    trial.fly_until(26.5)
    after = trial.rig.position
    assert before.resets.xy_count == before.resets.z_count == 0
    assert after.resets.xy_count == after.resets.velocity_xy_count == after.resets.z_count == 1
    step = after.resets.position_total_ned
    assert step == after.resets.position_delta_ned
    assert step[0] == pytest.approx(50.0, abs=15.0)
    assert step[2] == pytest.approx(-30.0, abs=15.0)
    error = trial.rig.position_error(trial.truth)
    assert error[0] == pytest.approx(50.0, abs=12.0)  # 6 m/s since then
    assert error[2] == pytest.approx(-30.0, abs=6.0)
    assert trial.stopped & AidSource.GPS_POSITION == NONE


def test_a_vehicle_that_stands_takes_over_where_gps_says_it_stands() -> None:
    trial = Trial(start_s=60.0).fly_until(10.0).spoil(jump(north_m=30.0)).fly_until(16.5)
    assert trial.rig.position_error(trial.truth)[0] == pytest.approx(30.0, abs=1.0)
    assert trial.rig.position.resets.xy_count == 1
    assert trial.stopped == NONE


@pytest.mark.thorough
def test_with_the_barometer_as_reference_gps_height_may_drift_away() -> None:
    def drifting(readings: Readings) -> Readings:
        since_s = readings.truth.time_us * 1e-6 - JUMP_S
        return jump(up_m=0.15 * since_s)(readings)

    by_baro = Trial(EKF2_HGT_REF=0).fly_until(JUMP_S).spoil(drifting).fly_until(60.0)
    by_gps = Trial(EKF2_HGT_REF=1).fly_until(JUMP_S).spoil(drifting).fly_until(60.0)
    assert by_baro.worst_down_m < 1.0
    assert by_gps.worst_down_m > by_baro.worst_down_m
