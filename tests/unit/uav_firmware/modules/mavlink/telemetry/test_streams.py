import math
from collections import Counter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.messages import changed, fields_of
from tests.unit.uav_firmware.modules.mavlink.harness import (
    ALTITUDE_M,
    BROKER,
    GROUND,
    LATITUDE_DEG,
    LOCAL,
    LONGITUDE_DEG,
    MavlinkHarness,
    empty_topics,
    flying_topics,
    status,
)
from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.commands.modes import OFFERED
from uav_firmware.modules.mavlink.telemetry.context import BatteryThresholds, Context
from uav_firmware.modules.mavlink.telemetry.status import charge_state
from uav_firmware.modules.mavlink.telemetry.streams import (
    BUILDERS,
    STREAMS,
    LinkMode,
    LinkParams,
    stream_key,
)
from uav_firmware.modules.mavlink.telemetry.streams import build as built_all
from uav_firmware.modules.mavlink.wire.addressing import CAMERA_COMPONENT
from uav_firmware.modules.mavlink.wire.dialect import frame, mavlink, pack
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.estimate import VehicleAttitude
from uav_firmware.msg.mission import Mission, MissionItem, MissionProgress
from uav_firmware.msg.sensors import SensorHygrometer, SensorMag, SensorRange
from uav_firmware.msg.status import LandDetected, LandedState, NavigationState
from uav_firmware.topics import Topics

THRESHOLDS = BatteryThresholds(low=0.15, critical=0.07, emergency=0.05)
ITEM = MissionItem(0, 16, 3, True, True, 0, 0, 0, 0, 0, 0, 0)
SECOND_US = 1_000_000
# What PX4 streams by itself [Hz], as far as this vehicle has it.
PX4_GROUND_STATION_HZ = {
    "ALTITUDE": 1,
    "ATTITUDE": 15,
    "ATTITUDE_QUATERNION": 10,
    "ATTITUDE_TARGET": 2,
    "AVAILABLE_MODES": 0.3,
    "AVAILABLE_MODES_MONITOR": 0.3,
    "BATTERY_STATUS": 0.5,
    "CURRENT_MODE": 0.5,
    "ESTIMATOR_STATUS": 0.5,
    "EXTENDED_SYS_STATE": 1,
    "GLOBAL_POSITION_INT": 5,
    "GPS_GLOBAL_ORIGIN": 1,
    "GPS_RAW_INT": 5,
    "HEARTBEAT": 2,  # Before and behind those of the cameras
    "HOME_POSITION": 0.5,
    "LOCAL_POSITION_NED": 1,
    "MISSION_CURRENT": 1,
    "NAV_CONTROLLER_OUTPUT": 1,
    "ORBIT_EXECUTION_STATUS": 2,
    "PING": 0.1,
    "POSITION_TARGET_GLOBAL_INT": 1,
    "POSITION_TARGET_LOCAL_NED": 1.5,
    "RC_CHANNELS": 5,
    "SCALED_PRESSURE": 1,
    "SERVO_OUTPUT_RAW": 1,
    "SYS_STATUS": 1,
    "SYSTEM_TIME": 1,
    "VFR_HUD": 4,
    "VIBRATION": 0.1,
    "WIND_COV": 0.5,
}
PX4_ONBOARD_HZ = {
    "ALTITUDE": 10,
    "ATTITUDE": 100,
    "ATTITUDE_QUATERNION": 50,
    "ATTITUDE_TARGET": 10,
    "BATTERY_STATUS": 0.5,
    "ESTIMATOR_STATUS": 1,
    "EXTENDED_SYS_STATE": 5,
    "GLOBAL_POSITION_INT": 50,
    "GPS_GLOBAL_ORIGIN": 1,
    "GPS_RAW_INT": 10,  # Rate of the receiver
    "HEARTBEAT": 2,  # Before and behind those of the cameras
    "HIGHRES_IMU": 50,
    "HOME_POSITION": 0.5,
    "LOCAL_POSITION_NED": 30,
    "NAV_CONTROLLER_OUTPUT": 10,
    "ODOMETRY": 30,
    "ORBIT_EXECUTION_STATUS": 5,
    "PING": 1,
    "POSITION_TARGET_GLOBAL_INT": 10,
    "POSITION_TARGET_LOCAL_NED": 10,
    "RC_CHANNELS": 20,
    "SCALED_PRESSURE": 1,
    "SERVO_OUTPUT_RAW": 10,
    "SYS_STATUS": 5,
    "SYSTEM_TIME": 1,
    "TIMESYNC": 10,
    "VFR_HUD": 10,
    "VIBRATION": 0.5,
    "WIND_COV": 10,
}


def context(topics: Topics, now_us: int = 5 * SECOND_US) -> Context:
    return Context(topics, now_us, 1_700_000_000_000_000, 7, THRESHOLDS, (0.1, 0.2, 0.3))


def build(name: str, topics: Topics | None = None) -> Any:
    identifier = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    return BUILDERS[identifier](context(topics or flying_topics()))


def received_in(
    seconds: int, params: LinkParams | None = None
) -> tuple[Counter[str], Counter[str]]:
    """Default streams to ground station and broker."""
    harness = MavlinkHarness(params=params)
    harness.run(seconds * SECOND_US)
    ground = Counter(message.get_type() for message in harness.received(at=GROUND))
    return ground, Counter(message.get_type() for message in harness.received(at=BROKER))


def test_default_rates_are_px4s() -> None:
    seconds = 20
    received = received_in(seconds)
    for link, rates_hz in zip(received, (PX4_GROUND_STATION_HZ, PX4_ONBOARD_HZ), strict=True):
        for name, rate_hz in rates_hz.items():
            assert link[name] == pytest.approx(seconds * rate_hz, abs=3), name


def test_a_parameter_sets_the_mode_of_a_link() -> None:
    _, normal = received_in(10, LinkParams(onboard_mode=LinkMode.NORMAL))
    assert normal["ATTITUDE"] == pytest.approx(150, abs=2)
    assert normal["ODOMETRY"] == 0
    ground, custom = received_in(10, LinkParams(onboard_mode=LinkMode.CUSTOM))
    assert set(custom) <= {"HEARTBEAT", "CURRENT_MODE", "EXTENDED_SYS_STATE", "HOME_POSITION",
                           "MISSION_CURRENT", "GIMBAL_MANAGER_STATUS"}  # fmt: skip
    assert custom["HEARTBEAT"] >= 10
    assert ground["ATTITUDE"] == pytest.approx(150, abs=2)


def test_timestamps_are_vehicle_time() -> None:
    topics = flying_topics()
    topics.vehicle_attitude.publish(
        VehicleAttitude(12_345_678, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    )
    assert build("ATTITUDE", topics).time_boot_ms == 12_345
    assert build("SYSTEM_TIME").time_boot_ms == 5000
    assert build("SYSTEM_TIME").time_unix_usec == 1_700_000_005_000_000


def test_only_known_values_are_sent_at_boot() -> None:
    harness = MavlinkHarness(topics=empty_topics())
    harness.run(3 * SECOND_US)
    received = {message.get_type() for message in harness.received()}
    assert received == {
        "AVAILABLE_MODES",
        "AVAILABLE_MODES_MONITOR",
        "HEARTBEAT",
        "MISSION_CURRENT",
        "PING",
        "RC_CHANNELS",
        "SYSTEM_TIME",
    }


def test_the_heartbeat_of_a_vehicle_on_a_mission() -> None:
    topics = flying_topics()
    topics.vehicle_status.publish(status(NavigationState.AUTO_MISSION, armed=True))
    heartbeat = build("HEARTBEAT", topics)
    assert (heartbeat.type, heartbeat.autopilot) == (2, 12)
    assert heartbeat.custom_mode == 0x04040000
    assert heartbeat.base_mode == 128 | 16 | 8 | 4 | 1
    assert heartbeat.system_status == mavlink.MAV_STATE_ACTIVE


@pytest.mark.parametrize(
    ("armed", "failsafe", "expected"),
    [
        (False, False, mavlink.MAV_STATE_STANDBY),
        (True, False, mavlink.MAV_STATE_ACTIVE),
        (True, True, mavlink.MAV_STATE_CRITICAL),
    ],
)
def test_the_system_status_follows_arming_and_failsafe(
    armed: bool, failsafe: bool, expected: int
) -> None:
    topics = empty_topics()
    topics.vehicle_status.publish(status(armed=armed, failsafe=failsafe))
    heartbeat = build("HEARTBEAT", topics)
    assert heartbeat.system_status == expected
    assert bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED) == armed


@pytest.mark.parametrize("ready", [True, False])
def test_the_prearm_bit_reports_whether_arming_is_possible(ready: bool) -> None:
    topics = flying_topics()
    topics.vehicle_status.publish(status(ready=ready))
    message = build("SYS_STATUS", topics)
    bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert message.onboard_control_sensors_present & bit
    assert message.onboard_control_sensors_enabled & bit
    assert bool(message.onboard_control_sensors_health & bit) == ready
    assert (message.voltage_battery, message.current_battery) == (11_800, 1450)
    assert message.battery_remaining == 76


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda t: t.vehicle_status.publish(status(NavigationState.AUTO_RTL, armed=True)), "mode"),
        (lambda t: t.vehicle_status.publish(status(armed=False)), "arming"),
        (
            lambda t: t.land_detected.publish(
                LandDetected(0, True, True, LandedState.ON_GROUND, True)
            ),
            "",
        ),
    ],
)
def test_a_change_triggers_a_heartbeat_at_once(change: Any, expected: str) -> None:
    harness = MavlinkHarness()
    harness.run(2 * SECOND_US + 100_000)
    harness.received()
    change(harness.topics)
    harness.run()
    assert len(harness.received("HEARTBEAT")) >= 1, expected


def test_an_unchanged_status_is_not_sent_again() -> None:
    harness = MavlinkHarness()
    harness.run(2 * SECOND_US)
    harness.received()
    for _ in range(20):
        harness.topics.vehicle_status.publish(status(armed=True))
        harness.run()
    assert len(harness.received("HEARTBEAT")) <= 1


def test_velocity_and_heading_have_the_correct_signs() -> None:
    message = build("GLOBAL_POSITION_INT")
    assert (message.vx, message.vy, message.vz) == (100, -200, 50)
    assert message.hdg == 27_000
    assert message.lat == round(LATITUDE_DEG * 1e7)
    assert message.lon == round(LONGITUDE_DEG * 1e7)
    assert message.alt == round((ALTITUDE_M + 10.0) * 1e3)
    assert message.relative_alt == 10_000
    hud = build("VFR_HUD")
    assert (hud.heading, hud.throttle) == (270, 50)
    assert hud.climb == pytest.approx(-0.5)
    assert hud.groundspeed == pytest.approx(math.hypot(1.0, 2.0))
    fix = build("GPS_RAW_INT")
    assert fix.cog == round(math.degrees(math.atan2(-2.0, 1.0)) * 100) % 36_000
    assert fix.alt_ellipsoid == round((ALTITUDE_M + 61.6) * 1e3)


def test_altitudes_are_consistent() -> None:
    message = build("ALTITUDE")
    assert message.altitude_amsl == pytest.approx(ALTITUDE_M + 10.0)
    assert message.altitude_relative == pytest.approx(10.0)
    assert message.altitude_local == pytest.approx(10.0)
    home = build("HOME_POSITION")
    assert home.altitude == round(ALTITUDE_M * 1e3)
    assert home.q == [1.0, 0.0, 0.0, 0.0]


def test_an_invalid_position_is_not_sent() -> None:
    topics = flying_topics()
    topics.vehicle_local_position.publish(changed(LOCAL, position_valid=False))
    assert build("LOCAL_POSITION_NED", topics) is None
    assert build("GPS_GLOBAL_ORIGIN", topics) is None


def test_unset_values_of_the_setpoint_are_masked() -> None:
    message = build("POSITION_TARGET_LOCAL_NED")
    assert message.type_mask == 0b1000_0001_1111_1000 & 0xFFF | 0b1000_0000_0000
    assert (message.x, message.y, message.z, message.vx) == (3.0, 8.0, -10.0, 0.0)
    output = build("NAV_CONTROLLER_OUTPUT")
    assert (output.nav_bearing, output.wp_dist) == (90, 4)


def test_the_distance_is_to_the_current_waypoint() -> None:
    topics = flying_topics()
    setpoint = topics.trajectory_setpoint.value
    assert setpoint is not None
    north, east, down = LOCAL.position_ned
    topics.trajectory_setpoint.publish(
        changed(setpoint, goal_ned=(north - 30.0, east + 40.0, down - 20.0))
    )
    output = build("NAV_CONTROLLER_OUTPUT", topics)
    assert (output.target_bearing, output.wp_dist) == (127, 50)
    assert (output.nav_bearing, output.alt_error) == (90, down + 10.0)


def test_motors_are_sent_as_pulse_widths() -> None:
    message = build("SERVO_OUTPUT_RAW")
    assert (message.servo1_raw, message.servo4_raw, message.servo5_raw) == (1500, 1500, 0)


def test_battery_time_and_charge() -> None:
    message = build("BATTERY_STATUS")
    assert message.voltages[0] == 11_800
    assert message.voltages[1:] == [0xFFFF] * 9
    assert message.current_consumed == 1200
    assert message.time_remaining == pytest.approx(0.76 * 5.0 / 14.5 * 3600, abs=1)
    assert message.charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_OK


def test_the_charge_is_unknown_while_no_monitor_measures_it() -> None:
    topics = flying_topics()
    status = topics.vehicle_status.value
    assert status is not None
    ill = status.sensors_health & ~mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    topics.vehicle_status.publish(
        status._replace(
            sensors_present=status.sensors_present | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY,
            sensors_health=ill,
        )
    )
    message = build("SYS_STATUS", topics)
    assert (message.voltage_battery, message.current_battery) == (0xFFFF, -1)
    assert message.battery_remaining == -1
    battery = build("BATTERY_STATUS", topics)
    assert battery.voltages == [0xFFFF] * 10
    assert (battery.current_battery, battery.battery_remaining) == (-1, -1)
    assert (battery.current_consumed, battery.time_remaining) == (-1, 0)
    assert battery.charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_charge_state_is_monotonic(one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert charge_state(low, THRESHOLDS) >= charge_state(high, THRESHOLDS)


def test_the_truth_is_sent_only_on_request() -> None:
    harness = MavlinkHarness()
    harness.run(3 * SECOND_US)
    assert harness.received("HIL_STATE_QUATERNION") == []
    truth = build("HIL_STATE_QUATERNION")
    assert (truth.vx, truth.zacc, truth.true_airspeed) == (100, -1000, 220)


def test_flight_information_has_times_and_a_unique_id() -> None:
    topics = flying_topics()
    status = topics.vehicle_status.value
    assert status is not None
    since = status._replace(armed_since_us=2_000_000, airborne_since_us=3_500_000)
    topics.vehicle_status.publish(since)
    flight = build("FLIGHT_INFORMATION", topics)
    assert (flight.arming_time_utc, flight.takeoff_time_utc) == (2_000_000, 3_500_000)
    topics.vehicle_status.publish(since._replace(armed_since_us=2_000_001))
    assert build("FLIGHT_INFORMATION", topics).flight_uuid != flight.flight_uuid
    topics.vehicle_status.publish(since._replace(armed_since_us=0, airborne_since_us=0))
    assert build("FLIGHT_INFORMATION", topics).flight_uuid == 0


def test_mission_current_has_the_state_of_the_stored_mission() -> None:
    topics = flying_topics()
    assert build("MISSION_CURRENT", topics).mission_state == mavlink.MISSION_STATE_NO_MISSION
    assert build("MISSION_CURRENT", topics).total == 0xFFFF
    topics.mission.publish(Mission(time_us=0, mission_id=99, items=(ITEM,) * 5))
    topics.mission_progress.publish(MissionProgress(0, 55, 3, 4, 2, 3, 3))
    waiting = build("MISSION_CURRENT", topics)
    assert (waiting.seq, waiting.mission_state) == (0, mavlink.MISSION_STATE_NOT_STARTED)
    topics.mission_progress.publish(MissionProgress(0, 99, 3, 5, 2, 3, 3))
    topics.vehicle_status.publish(status(NavigationState.AUTO_MISSION, armed=True))
    active = build("MISSION_CURRENT", topics)
    assert (active.seq, active.total, active.mission_id) == (3, 5, 99)
    assert (active.mission_state, active.mission_mode) == (mavlink.MISSION_STATE_ACTIVE, 1)
    topics.mission_progress.publish(MissionProgress(0, 99, 5, 5, 4, 5, 5))
    complete = build("MISSION_CURRENT", topics)
    assert (complete.seq, complete.mission_state) == (4, mavlink.MISSION_STATE_COMPLETE)


def broken(value: Any, number: float) -> Any:
    """A topic's value with every float, also inside vectors, replaced."""
    if isinstance(value, float):
        return number
    if isinstance(value, tuple) and not hasattr(value, "_replace"):
        return tuple(broken(part, number) for part in value)
    return value


@pytest.mark.first_case
@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e300, -1e300])
def test_a_diverged_estimate_drops_messages_only(number: float) -> None:
    topics = flying_topics()
    for name in Topics.__dataclass_fields__:
        topic = getattr(topics, name)
        if isinstance(topic, Topic) and topic.value is not None:
            old = topic.value
            fields = {name: broken(value, number) for name, value in fields_of(old).items()}
            topic.publish(changed(old, **fields))
    harness = MavlinkHarness(topics=topics)
    harness.run(12 * SECOND_US)
    received = {message.get_type() for message in harness.received(at=GROUND)}
    assert {"HEARTBEAT", "SYS_STATUS", "EXTENDED_SYS_STATE"} <= received


def test_every_stream_builds_and_packs() -> None:
    topics = flying_topics()
    topics.mission.publish(Mission(time_us=0, mission_id=1, items=(ITEM,)))
    for stream in STREAMS:
        messages = built_all(stream.builder, context(topics))
        assert messages
        for message, again in zip(
            messages, built_all(stream.builder, context(topics)), strict=True
        ):
            payload = pack(again)
            assert payload.message_id == stream.message_id
            assert frame(payload, 0, 7, 1) == message.pack(mavlink.MAVLink(None, 7, 1))


def test_air_and_soil_measurements_are_encoded() -> None:
    topics = flying_topics()
    air = build("HYGROMETER_SENSOR", topics)
    assert (air.temperature, air.humidity) == (2137, 5432)
    builder = BUILDERS[mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT]
    reported = {m.name: m.value for m in built_all(builder, context(topics))}
    assert reported == {"soil_moist": 23.0, "temp_soil": 17.5, "light": 65_000.0}


def test_hygrometer_without_humidity_and_without_samples() -> None:
    topics = flying_topics()
    topics.sensor_hygrometer.publish(SensorHygrometer(4_900_000, 21.0, math.nan))
    assert build("HYGROMETER_SENSOR", topics).humidity == 65_535
    builder = BUILDERS[mavlink.MAVLINK_MSG_ID_HYGROMETER_SENSOR]
    assert not built_all(builder, context(topics)._replace(now_us=60_000_000))


def test_out_of_range_distance_exceeds_the_maximum() -> None:
    topics = flying_topics()
    near = build("DISTANCE_SENSOR", topics)
    assert (near.current_distance, near.min_distance, near.max_distance) == (1000, 10, 4000)
    topics.sensor_range.publish(SensorRange(0, math.nan, 0.1, 40.0))
    far = build("DISTANCE_SENSOR", topics)
    assert far.current_distance > far.max_distance
    assert far.signal_quality < near.signal_quality


def test_an_orbit_is_reported_with_signed_radius_while_active() -> None:
    topics = flying_topics()
    message = build("ORBIT_EXECUTION_STATUS", topics)
    assert message.radius == -10.0
    assert (message.x, message.y) == (round(LATITUDE_DEG * 1e7), round(LONGITUDE_DEG * 1e7))
    assert message.z == ALTITUDE_M + 10.0
    assert topics.orbit_status.value is not None
    topics.orbit_status.publish(topics.orbit_status.value._replace(active=False))
    assert build("ORBIT_EXECUTION_STATUS", topics) is None


def test_odometry_has_the_velocity_in_the_body_frame() -> None:
    topics = flying_topics()
    east = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    topics.vehicle_attitude.publish(VehicleAttitude(0, east, (0.1, 0.2, 0.3)))
    topics.vehicle_local_position.publish(changed(LOCAL, velocity_ned=(0.0, 2.0, 0.5)))
    odometry = build("ODOMETRY", topics)
    assert (odometry.frame_id, odometry.child_frame_id) == (1, 12)
    assert (odometry.x, odometry.y, odometry.z) == LOCAL.position_ned
    assert odometry.reset_counter == 0
    assert (odometry.vx, odometry.vy, odometry.vz) == pytest.approx((2.0, 0.0, 0.5))
    assert [odometry.pose_covariance[i] for i in (0, 6, 11)] == pytest.approx([0.25, 0.25, 0.64])
    assert math.isnan(odometry.pose_covariance[1])
    assert math.isnan(odometry.velocity_covariance[0])


def test_recent_sticks_are_sent_as_channels() -> None:
    topics = flying_topics()
    assert build("RC_CHANNELS", topics).chancount == 0
    topics.manual_control_setpoint.publish(
        ManualControlSetpoint(5 * SECOND_US, 1.0, -1.0, 0.0, 0.5)
    )
    channels = build("RC_CHANNELS", topics)
    assert channels.chancount == 4
    pulses = (channels.chan1_raw, channels.chan2_raw, channels.chan3_raw, channels.chan4_raw)
    assert pulses == (1000, 2000, 1500, 1750)
    assert channels.chan5_raw == 0xFFFF
    topics.manual_control_setpoint.publish(ManualControlSetpoint(3 * SECOND_US, 1.0, 0.0, 0.0, 0.0))
    assert build("RC_CHANNELS", topics).chancount == 0


def test_the_magnetic_field_is_sent_if_measured() -> None:
    topics = flying_topics()
    assert math.isnan(build("HIGHRES_IMU", topics).xmag)
    assert not build("HIGHRES_IMU", topics).fields_updated & 0b111 << 6
    topics.sensor_mag.publish(SensorMag(0, (0.2, -0.1, 0.4)))
    assert build("HIGHRES_IMU", topics).fields_updated & 0b111 << 6 == 0b111 << 6
    assert build("HIGHRES_IMU", topics).zmag == pytest.approx(0.4)
    scaled = build("SCALED_IMU", topics)
    assert (scaled.xmag, scaled.ymag, scaled.zmag) == (200, -100, 400)
    assert scaled.zacc == pytest.approx(-1000, abs=1)


def test_the_stream_sends_each_mode() -> None:
    harness = MavlinkHarness()
    harness.run((len(OFFERED) + 1) * 10 * SECOND_US // 3)
    indices = {message.mode_index for message in harness.received("AVAILABLE_MODES")}
    assert indices == set(range(1, len(OFFERED) + 1))


def test_streamed_ping_and_timesync_are_requests() -> None:
    ping, request = build("PING"), build("TIMESYNC")
    assert (ping.target_system, ping.target_component) == (0, 0)
    assert (request.tc1, request.ts1) == (0, 5_000_000_000)


def test_an_unresponsive_camera_sends_no_heartbeat() -> None:
    topics = flying_topics()
    key = stream_key(CAMERA_COMPONENT, mavlink.MAVLINK_MSG_ID_HEARTBEAT)
    assert built_all(BUILDERS[key], context(topics))
    status = topics.camera_status.value
    assert status is not None
    topics.camera_status.publish(status._replace(answers=False))
    assert not built_all(BUILDERS[key], context(topics))
