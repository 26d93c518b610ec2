"""Every stream of MAVSDK's telemetry that applies to the vehicle delivers what is so."""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest
from mavsdk.plugins.info import Info
from mavsdk.plugins.telemetry import FixType, LandedState, StatusTextType

from tests.conformance.mavsdk_client import (
    ALTITUDE_AMSL_M,
    LATITUDE_DEG,
    LONGITUDE_DEG,
    Pilot,
    connected,
)
from tests.support.system import wait_for

pytestmark = pytest.mark.scenario

SYSTEM = 9
SPEED = 5
G_M_S2 = 9.81


class Client(NamedTuple):
    """MAVSDK's plugins on one vehicle that flies."""

    pilot: Pilot
    telemetry: Any
    info: Any
    texts: list[Any]


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """A vehicle that holds 8 m above home."""
    with connected(SYSTEM, SPEED, tmp_path_factory.mktemp("vehicle")) as system:
        pilot = Pilot(system)
        texts: list[Any] = []
        pilot.telemetry.subscribe_status_text(lambda text, _user_data=None: texts.append(text))
        pilot.take_off()
        yield Client(pilot, pilot.telemetry, Info(system), texts)
        pilot.land()


class Stream(NamedTuple):
    """One stream, how it is asked for, and what it reports of a vehicle 8 m above home."""

    name: str
    is_so: Callable[[Any], bool]
    asked: bool = True  # Whether MAVSDK has a call that sets its rate


def near(value: float, wanted: float, tolerance: float) -> bool:
    return abs(value - wanted) < tolerance


def at_home(place: Any) -> bool:
    return near(place.latitude_deg, LATITUDE_DEG, 1e-4) and near(
        place.longitude_deg, LONGITUDE_DEG + 24 / 84_700, 1e-4
    )


def pulls_up(imu: Any) -> bool:
    """A vehicle that hovers feels its own lift."""
    force = imu.acceleration_frd
    rates = imu.angular_velocity_frd
    return near(force.down_m_s2, -G_M_S2, 3.0) and near(rates.down_rad_s, 0.0, 0.5)


STREAMS = (
    Stream(
        "position",
        lambda p: (
            at_home(p)
            and near(p.relative_altitude_m, 8.0, 1.5)
            and near(p.absolute_altitude_m, ALTITUDE_AMSL_M + 8.0, 8.0)
        ),
    ),
    Stream("home", lambda h: at_home(h) and near(h.absolute_altitude_m, ALTITUDE_AMSL_M, 8.0)),
    Stream("in_air", lambda flies: flies is True),
    Stream("landed_state", lambda s: LandedState(s) is LandedState.IN_AIR),
    Stream("attitude_euler", lambda a: near(a.roll_deg, 0.0, 5.0) and near(a.pitch_deg, 0.0, 5.0)),
    Stream(
        "attitude_quaternion",
        lambda q: near(math.hypot(q.w, q.x, q.y, q.z), 1.0, 1e-3) and q.timestamp_us > 0,
    ),
    Stream("attitude_angular_velocity_body", lambda r: near(r.yaw_rad_s, 0.0, 0.5), asked=False),
    Stream("velocity_ned", lambda v: near(v.north_m_s, 0.0, 1.0) and near(v.down_m_s, 0.0, 1.0)),
    Stream("gps_info", lambda g: FixType(g.fix_type) >= FixType.FIX_3D and g.num_satellites > 5),
    Stream(
        "raw_gps",
        lambda g: (
            at_home(g)
            and near(g.absolute_altitude_m, ALTITUDE_AMSL_M + 8.0, 12.0)
            and 0.0 < g.hdop < 5.0
        ),
    ),
    Stream("battery", lambda b: 50.0 < b.remaining_percent <= 100.0 and b.voltage_v > 10.0),
    Stream("health", lambda h: h.is_global_position_ok and h.is_home_position_ok),
    Stream("odometry", lambda o: near(o.position_body.z_m, -8.0, 1.5) and o.time_usec > 0),
    Stream("position_velocity_ned", lambda p: near(p.position.down_m, -8.0, 1.5)),
    Stream("ground_truth", at_home),
    Stream("imu", pulls_up),
    Stream("scaled_imu", lambda imu: near(imu.acceleration_frd.down_m_s2, -G_M_S2, 3.0)),
    Stream("unix_epoch_time", lambda us: us > 1_500_000_000_000_000),
    Stream("scaled_pressure", lambda p: 900.0 < p.absolute_pressure_hpa < 960.0, asked=False),
    Stream("heading", lambda h: near((h.heading_deg + 180.0) % 360.0, 180.0, 10.0), asked=False),
    Stream("altitude", lambda a: near(a.altitude_relative_m, 8.0, 1.5)),
    Stream("actuator_output_status", lambda a: a.active >= 4 and a.actuator[0] > 0.0),
    Stream("fixedwing_metrics", lambda m: near(m.climb_rate_m_s, 0.0, 1.0)),
    Stream("wind", lambda w: near(w.wind_x_ned_m_s, 0.0, 3.0), asked=False),
    Stream("rc_status", lambda rc: not rc.is_available),
)


@pytest.mark.parametrize("stream", STREAMS, ids=lambda stream: stream.name)
def test_a_telemetry_stream_has_the_expected_values(client: Client, stream: Stream) -> None:
    received: list[Any] = []
    subscribe = getattr(client.telemetry, f"subscribe_{stream.name}")
    handle = subscribe(lambda value, _user_data=None: received.append(value))
    if stream.asked:
        getattr(client.telemetry, f"set_rate_{stream.name}")(10.0)
    wait_for(lambda: any(stream.is_so(value) for value in list(received)), stream.name)
    getattr(client.telemetry, f"unsubscribe_{stream.name}")(handle)


def test_the_origin_of_the_local_frame_is_reported(client: Client) -> None:
    origin = client.telemetry.get_gps_global_origin()
    assert origin.latitude_deg == pytest.approx(LATITUDE_DEG, abs=1e-4)
    assert origin.altitude_m == pytest.approx(ALTITUDE_AMSL_M, abs=8.0)


def test_the_texts_for_the_operator_arrive_whole(client: Client) -> None:
    wait_for(lambda: any(text.text == "Armed" for text in client.texts), "the text of arming")
    assert {StatusTextType(text.type) for text in client.texts} <= set(StatusTextType)


def test_who_the_vehicle_is(client: Client) -> None:
    info = client.info
    version = wait_for(info.get_version, "the version")
    assert (version.flight_sw_major, version.flight_sw_minor) == (1, 16)
    assert info.get_identification().legacy_uid == SYSTEM
    assert info.get_product().vendor_id > 0
    wait_for(lambda: info.get_speed_factor() > 0.0, "the speed of the simulation")


def test_the_flight_state_is_reported(client: Client) -> None:
    received: list[Any] = []
    handle = client.info.subscribe_flight_information(
        lambda value, _user_data=None: received.append(value)
    )
    wait_for(lambda: any(i.duration_since_arming_ms > 0 for i in list(received)), "the flight")
    flight = received[-1]
    assert 0 < flight.duration_since_takeoff_ms <= flight.duration_since_arming_ms
    assert flight.flight_uid > 0
    client.info.unsubscribe_flight_information(handle)
