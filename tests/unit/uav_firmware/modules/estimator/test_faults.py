"""What goes wrong with sensors, and what the estimate does then."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.messages import changed
from tests.unit.uav_firmware.modules.estimator.flight import Readings, Rig, recorded
from uav_firmware.modules.estimator.health import StatusFlag, Validity, status_flags
from uav_firmware.msg.sensors import SensorBaro, SensorGps, SensorImu, SensorMag, SensorsStatus

NAN, INF = math.nan, math.inf
Change = Callable[[Readings], Readings]


def fly(
    rig: Rig,
    duration_s: float,
    change: Change | None = None,
    *,
    between_s: tuple[float, float] = (0.0, INF),
    seed: int = 1,
    start_s: float = 12.0,
    drag_per_s: float = 0.0,
) -> Readings:
    """Fly with the readings changed for a while; the last readings, with their truth."""
    last = None
    for readings in recorded(seed, start_s=start_s, drag_per_s=drag_per_s).steps(duration_s):
        now_s = readings.truth.time_us * 1e-6
        hit = change is not None and between_s[0] <= now_s < between_s[1]
        rig.feed(change(readings) if hit and change is not None else readings)
        last = readings
    assert last is not None
    return last


def flags(rig: Rig) -> StatusFlag:
    assert rig.status.value is not None
    return StatusFlag(rig.status.value.flags)


def assert_sound(rig: Rig, readings: Readings) -> None:
    assert np.abs(rig.position_error(readings.truth)).max() < 0.8
    assert np.abs(rig.velocity_error(readings.truth)).max() < 0.25
    assert np.abs(rig.attitude_error(readings.truth)[:2]).max() < math.radians(1.5)


def no_gps(readings: Readings) -> Readings:
    return readings._replace(gps=None)


def jumped_gps(north_deg: float) -> Change:
    def change(readings: Readings) -> Readings:
        gps = readings.gps
        if gps is None:
            return readings
        return readings._replace(gps=gps._replace(latitude_deg=gps.latitude_deg + north_deg))

    return change


def test_nothing_is_valid_before_alignment() -> None:
    rig = Rig()
    fly(rig, 0.5)
    assert rig.attitude.value is None
    assert rig.local.value is None
    assert flags(rig) == 0
    assert rig.status.value is not None
    assert not rig.status.value.aligned


def test_attitude_comes_before_position() -> None:
    rig = Rig()
    fly(rig, 2.0)
    assert rig.world.value is None
    assert rig.position.heading_valid
    assert not rig.position.position_valid
    assert not rig.position.altitude_valid
    assert StatusFlag.ATTITUDE in flags(rig)
    assert StatusFlag.CONST_POS_MODE in flags(rig)


@pytest.mark.thorough
def test_all_is_valid_in_flight() -> None:
    rig = Rig()
    last = fly(rig, 20.0)
    here = rig.position
    assert here.position_valid
    assert here.altitude_valid
    assert here.velocity_valid
    assert here.heading_valid
    assert flags(rig) == 831
    assert rig.status.value is not None
    assert rig.status.value.aligned
    assert_sound(rig, last)


def test_without_a_fix_there_is_no_position_and_no_drift() -> None:
    rig = Rig()
    fly(rig, 20.0, no_gps, start_s=100.0)
    assert rig.world.value is None
    assert not rig.position.position_valid
    assert math.isnan(rig.position.origin_latitude_deg)
    assert math.isnan(rig.position.horizontal_accuracy_m)
    assert np.abs(rig.position.position_ned).max() < 0.5


def test_a_poor_fix_gives_no_origin() -> None:
    def poor(readings: Readings) -> Readings:
        gps = readings.gps
        return readings if gps is None else readings._replace(gps=gps._replace(fix_type=2))

    rig = Rig()
    fly(rig, 8.0, poor)
    assert rig.world.value is None


@pytest.mark.thorough
def test_gps_loss_is_flown_through() -> None:
    rig = Rig()
    last = fly(rig, 29.9, no_gps, between_s=(20.0, 30.0))
    assert rig.position.position_valid
    assert np.abs(rig.position_error(last.truth)).max() < 5.0
    assert rig.position.horizontal_accuracy_m > 0.3


@pytest.mark.thorough
def test_a_long_gps_loss_ends_the_validity_of_position_not_of_attitude() -> None:
    rig = Rig()
    last = fly(rig, 60.0, no_gps, between_s=(20.0, INF))
    assert not rig.position.position_valid
    assert not rig.position.velocity_valid
    assert rig.position.altitude_valid
    assert StatusFlag.POS_HORIZ_ABS not in flags(rig)
    assert StatusFlag.ATTITUDE in flags(rig)
    assert np.abs(rig.attitude_error(last.truth)[:2]).max() < math.radians(8.0)


@pytest.mark.first_case
@pytest.mark.parametrize("until_s", [25.0, 45.0])
def test_gps_back_recovers(until_s: float) -> None:
    rig = Rig()
    last = fly(rig, until_s + 10.0, no_gps, between_s=(20.0, until_s))
    assert rig.position.position_valid
    assert_sound(rig, last)


def test_a_gps_outlier_is_gated() -> None:
    rig = Rig()
    # 50 m to the north for one second.
    last = fly(rig, 20.98, jumped_gps(4.5e-4), between_s=(20.0, 21.0))
    assert rig.status.value is not None
    assert rig.status.value.horizontal_position_ratio > 1.0
    assert StatusFlag.GPS_GLITCH in flags(rig)
    assert_sound(rig, last)


@pytest.mark.thorough
def test_a_blow_beyond_the_range_of_the_accelerometer_is_found_by_the_next_fixes() -> None:
    """A push of 3 m/s within one sample that reads 16 g: not 5 s of rejected fixes."""
    blow_s, gained_m_s = 20.0, 3.0
    struck: list[SensorImu] = []

    def blown(readings: Readings) -> Readings:
        imu, gps = readings.imu, readings.gps
        if not struck:
            struck.append(imu)
            _, y, z = imu.specific_force_frd
            readings = readings._replace(imu=changed(imu, specific_force_frd=(157.0, y, z)))
        since_s = 0.0 if gps is None else gps.time_us * 1e-6 - blow_s
        if gps is None or since_s < 0.0:
            return readings
        north, east, down = gps.velocity_ned
        moved = gps._replace(
            latitude_deg=gps.latitude_deg + gained_m_s * since_s / 111_000.0,
            velocity_ned=(north + gained_m_s, east, down),
        )
        return readings._replace(gps=moved)

    rig = Rig()
    last = fly(rig, 20.6, blown, between_s=(blow_s, INF))
    assert StatusFlag.GPS_GLITCH not in flags(rig)
    north_m_s, east_m_s, _ = rig.velocity_error(last.truth)
    assert abs(north_m_s) == pytest.approx(gained_m_s, abs=0.4)
    assert abs(east_m_s) < 0.4
    assert abs(rig.position_error(last.truth)[0]) == pytest.approx(gained_m_s * 0.6, abs=0.8)


@pytest.mark.thorough
def test_a_receiver_that_repeats_itself_is_not_believed() -> None:
    held: list[SensorGps] = []

    def frozen(readings: Readings) -> Readings:
        if readings.gps is None:
            return readings
        held.append(readings.gps)
        return readings._replace(gps=held[0]._replace(time_us=readings.gps.time_us))

    rig = Rig()
    last = fly(rig, 25.0, frozen, between_s=(20.0, INF))
    assert np.abs(rig.position_error(last.truth)[:2]).max() < 5.0
    last = fly(rig, 50.0, frozen, between_s=(20.0, INF))
    assert not rig.position.position_valid


@pytest.mark.thorough
def test_a_spinning_compass_is_gated_and_heading_kept() -> None:
    def swapped(readings: Readings) -> Readings:
        mag = readings.mag
        if mag is None:
            return readings
        x, y, z = mag.field_frd
        return readings._replace(mag=mag._replace(field_frd=(-y, x, z)))

    rig = Rig()
    last = fly(rig, 40.0, swapped, between_s=(20.0, INF))
    assert abs(rig.attitude_error(last.truth)[2]) < math.radians(4.0)
    assert_sound(rig, last)


def jumped_gyro(*jump_deg_s: float) -> Change:
    def change(readings: Readings) -> Readings:
        x, y, z = (
            rate + math.radians(jump)
            for rate, jump in zip(readings.imu.rate_frd, jump_deg_s, strict=True)
        )
        return readings._replace(imu=changed(readings.imu, rate_frd=(x, y, z)))

    return change


def late_by(fixes: int) -> Change:
    """A receiver that hands over each fix under the time of one `fixes` later."""
    waiting: list[SensorGps] = []

    def change(readings: Readings) -> Readings:
        if readings.gps is None:
            return readings
        waiting.append(readings.gps)
        old = waiting[max(0, len(waiting) - 1 - fixes)]
        return readings._replace(gps=old._replace(time_us=readings.gps.time_us))

    return change


def biased_velocity(north_m_s: float, east_m_s: float) -> Change:
    def change(readings: Readings) -> Readings:
        gps = readings.gps
        if gps is None:
            return readings
        north, east, down = gps.velocity_ned
        biased = (north + north_m_s, east + east_m_s, down)
        return readings._replace(gps=gps._replace(velocity_ned=biased))

    return change


@pytest.mark.first_case
@pytest.mark.parametrize("lie", [late_by(3), biased_velocity(1.5, -1.0)], ids=["late", "biased"])
def test_a_receiver_that_lies_does_not_tilt_several_gyroscopes_that_agree(lie: Change) -> None:
    rig = Rig()
    rig.sensors.publish(SensorsStatus(0, 0, 0, 0, 0, gyros_agree=True, accels_agree=True))
    worst_deg = 0.0
    for readings in recorded(1).steps(45.0):
        rig.feed(lie(readings) if readings.truth.time_us > 18_000_000 else readings)
        if readings.truth.time_us > 18_000_000:
            tilt = np.abs(rig.attitude_error(readings.truth)[:2]).max()
            worst_deg = max(worst_deg, math.degrees(float(tilt)))
    assert rig.status.value is not None
    assert rig.status.value.gyro_jump_us is None
    assert not rig.status.value.gyro_broken
    assert worst_deg < 5.0


@pytest.mark.first_case
@pytest.mark.parametrize("drag_per_s", [0.0, 0.15, 0.3, 0.45])
def test_a_jump_of_the_gyroscope_bias_is_followed_and_one_beyond_the_limit_told(
    drag_per_s: float,
) -> None:
    """Whatever the drag of the rotors, of which this airframe states no coefficient."""
    jump_deg_s = (3.0, 3.0, -5.0)
    rig = Rig(EKF2_GYR_B_LIM=math.radians(4.0))
    jump = jumped_gyro(*jump_deg_s)
    last = fly(rig, 26.0, jump, between_s=(18.0, INF), drag_per_s=drag_per_s)
    assert rig.status.value is not None
    assert not rig.status.value.accel_broken
    assert rig.status.value.gyro_jump_us is not None
    assert rig.status.value.gyro_broken
    assert rig.position.position_valid
    assert np.abs(rig.position_error(last.truth)).max() < 0.8
    assert np.abs(rig.attitude_error(last.truth)[:2]).max() < math.radians(4.0)
    found_deg_s = [math.degrees(bias) for bias in rig.status.value.gyro_bias_frd]
    assert found_deg_s == pytest.approx(jump_deg_s, abs=1.0)


@pytest.mark.thorough
def test_a_frozen_barometer_leaves_the_height_to_gps() -> None:
    held: list[SensorBaro] = []

    def frozen(readings: Readings) -> Readings:
        if readings.baro is None:
            return readings
        held.append(readings.baro)
        return readings._replace(baro=held[0]._replace(time_us=readings.baro.time_us))

    rig = Rig()
    last = fly(rig, 45.0, frozen, between_s=(20.0, INF))
    assert rig.position.altitude_valid
    assert abs(rig.position_error(last.truth)[2]) < 0.8


@pytest.mark.first_case
@pytest.mark.parametrize(
    "bad",
    [
        SensorImu(0, (NAN, 0.0, 0.0), (0.0, 0.0, -9.8)),
        SensorImu(0, (0.0, 0.0, 0.0), (INF, 0.0, 0.0)),
        SensorImu(0, (1e9, 0.0, 0.0), (0.0, 0.0, -9.8)),
        SensorBaro(0, NAN, 20.0),
        SensorBaro(0, -5.0, NAN),
        SensorMag(0, (NAN, NAN, NAN)),
        SensorMag(0, (1e30, 0.0, 0.0)),
        SensorGps(0, 0, NAN, 0.0, 0.0, (0.0, 0.0, 0.0), 0.1, 0.1, 0.1, 3, 12, 1.0, 1.0),
        SensorGps(0, 0, 91.0, 0.0, 0.0, (0.0, 0.0, 0.0), 0.1, 0.1, 0.1, 3, 12, 1.0, 1.0),
        SensorGps(0, 0, 40.0, 0.0, 650.0, (0.0, INF, 0.0), 0.1, 0.1, 0.1, 3, 12, 1.0, 1.0),
        SensorGps(0, 0, 40.0, 0.0, 650.0, (0.0, 0.0, 0.0), NAN, 0.1, 0.1, 3, 12, 1.0, 1.0),
        SensorGps(0, 0, 40.0, 0.0, 650.0, (0.0, 0.0, 0.0), -1.0, 0.1, 0.1, 3, 12, 1.0, 1.0),
    ],
)
def test_absurd_values_do_not_reach_the_state(
    bad: SensorImu | SensorBaro | SensorMag | SensorGps,
) -> None:
    def spoil(readings: Readings) -> Readings:
        """Every fifteenth moment, in place of the sensor's own value if it has one then."""
        if readings.truth.time_us % 60_000:
            return readings
        if isinstance(bad, SensorImu):
            return readings._replace(imu=changed(bad, time_us=readings.imu.time_us))
        if isinstance(bad, SensorBaro) and readings.baro is not None:
            return readings._replace(baro=bad._replace(time_us=readings.baro.time_us))
        if isinstance(bad, SensorMag) and readings.mag is not None:
            return readings._replace(mag=bad._replace(time_us=readings.mag.time_us))
        if isinstance(bad, SensorGps) and readings.gps is not None:
            return readings._replace(gps=bad._replace(time_us=readings.gps.time_us))
        return readings

    rig = Rig()
    last = fly(rig, 22.0, spoil, between_s=(16.0, INF))
    assert rig.position.position_valid
    assert_sound(rig, last)


@pytest.mark.thorough
def test_a_dead_imu_is_reported() -> None:
    def dead(readings: Readings) -> Readings:
        return readings._replace(imu=changed(readings.imu, rate_frd=(NAN, NAN, NAN)))

    rig = Rig()
    fly(rig, 21.0, dead, between_s=(20.0, INF))
    assert StatusFlag.ACCEL_ERROR in flags(rig)
    assert StatusFlag.ATTITUDE not in flags(rig)
    assert not rig.position.position_valid


@pytest.mark.thorough
def test_a_fix_from_the_future_or_from_long_ago_is_not_used() -> None:
    for shift_us in (60_000_000, -5_000_000):

        def shifted(readings: Readings, shift_us: int = shift_us) -> Readings:
            gps = readings.gps
            if gps is None:
                return readings
            return readings._replace(gps=gps._replace(time_us=gps.time_us + shift_us))

        rig = Rig()
        fly(rig, 8.0, shifted)
        assert rig.world.value is None


times = st.integers(0, 5_000_000)
numbers = st.floats(allow_nan=True, allow_infinity=True)
triples = st.tuples(numbers, numbers, numbers)
messages = st.one_of(
    st.builds(SensorImu, times, triples, triples),
    st.builds(SensorBaro, times, numbers, numbers),
    st.builds(SensorMag, times, triples),
    st.builds(
        SensorGps,
        time_us=times,
        time_utc_us=times,
        latitude_deg=numbers,
        longitude_deg=numbers,
        altitude_amsl_m=numbers,
        velocity_ned=triples,
        horizontal_accuracy_m=numbers,
        vertical_accuracy_m=numbers,
        speed_accuracy_m_s=numbers,
        fix_type=st.integers(0, 6),
        satellites_used=st.integers(0, 30),
        hdop=numbers,
        vdop=numbers,
    ),
)


def publish(rig: Rig, message: SensorImu | SensorBaro | SensorMag | SensorGps) -> None:
    if isinstance(message, SensorImu):
        rig.imu.publish(message)
    elif isinstance(message, SensorBaro):
        rig.baro.publish(message)
    elif isinstance(message, SensorMag):
        rig.mag.publish(message)
    else:
        rig.gps.publish(message)
    rig.module.update()


@pytest.mark.thorough
@given(st.lists(messages, max_size=40))
@settings(max_examples=60, deadline=None)
def test_no_message_in_any_order_breaks_an_aligned_estimator(
    hostile: list[SensorImu | SensorBaro | SensorMag | SensorGps],
) -> None:
    rig = Rig(EKF2_REQ_GPS_H=0.2)
    fly(rig, 1.6)
    for message in hostile:
        publish(rig, message)
    core = rig.module.estimator.core
    assert core is not None
    assert core.state.is_finite()
    assert np.isfinite(core.ekf.covariance).all()


@given(st.lists(messages, max_size=30))
@settings(max_examples=60, deadline=None)
def test_no_message_in_any_order_breaks_a_fresh_estimator(
    hostile: list[SensorImu | SensorBaro | SensorMag | SensorGps],
) -> None:
    rig = Rig()
    for message in hostile:
        publish(rig, message)


@pytest.mark.thorough
def test_parameters_change_in_flight() -> None:
    rig = Rig()
    for readings in recorded(1).steps(16.0):
        rig.feed(readings)
    rig.registry.set("EKF2_GPS_P_GATE", 1.0)
    rig.registry.set("EKF2_NOAID_TOUT", 500_000)
    rig.module.update()
    rig.imu.publish(changed(readings.imu, time_us=readings.imu.time_us + 4000))
    rig.module.update()
    assert rig.module.estimator.gps.horizontal.gate == 1.0


@pytest.mark.parametrize(
    ("validity", "expected"),
    [
        (Validity(), StatusFlag(0)),
        (Validity(attitude=True), StatusFlag.CONST_POS_MODE),
        (
            Validity(attitude=True, heading=True, altitude=True),
            StatusFlag.ATTITUDE
            | StatusFlag.VELOCITY_VERT
            | StatusFlag.POS_VERT_ABS
            | StatusFlag.CONST_POS_MODE,
        ),
        (Validity(gps_rejected=True), StatusFlag.GPS_GLITCH),
        (Validity(accelerometer_bad=True), StatusFlag.ACCEL_ERROR),
    ],
)
def test_validity_in_mavlinks_words(validity: Validity, expected: StatusFlag) -> None:
    assert status_flags(validity) == expected
