"""Measurements of the environment: units, names, places, and what is too old to be reported."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.state import ObservationList
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.vehicle.measurements import Observations, readings
from mavlink_broker.vehicle.telemetry import Snapshot


def received(message: Message, component: int = 1) -> Message:
    (decoded,) = Decoder().decode(Encoder(1, component).encode(message))
    return decoded


def named(name: str, value: float) -> Message:
    return mavlink.MAVLink_named_value_float_message(1000, name.encode(), value)


def hygrometer(temperature_deg: float = 21.5, humidity: float = 48.25, number: int = 0) -> Message:
    return mavlink.MAVLink_hygrometer_sensor_message(
        number, round(temperature_deg * 100), round(humidity * 100)
    )


def wind_cov(north_m_s: float, east_m_s: float, accuracy_m_s: float = 0.0) -> Message:
    return mavlink.MAVLink_wind_cov_message(0, north_m_s, east_m_s, 0, 0, 0, 0, accuracy_m_s, 0)


def at(time_s: float, latitude_deg: float = 40.0) -> Snapshot:
    """A vehicle 5 m above home at a time since it was switched on."""
    snapshot = Snapshot()
    snapshot.take(
        mavlink.MAVLink_global_position_int_message(
            round(time_s * 1e3), round(latitude_deg * 1e7), -37_000_000, 0, 5_000, 0, 0, 0, 0
        )
    )
    return snapshot


class Sensors:
    """What has been measured on a flight."""

    def __init__(self) -> None:
        self.observations = Observations()
        self.snapshot = at(100.0)

    def receive(self, *messages: Message, component: int = 1, now: float = 0.0) -> None:
        for message in messages:
            self.observations.take(received(message, component), self.snapshot, now)

    def lists(self, now: float = 0.0) -> list[ObservationList]:
        lists = self.observations.lists(self.snapshot, now, vehicle_id=7, sequence_number=4)
        return list(lists)

    def values(self, now: float = 0.0) -> dict[str, tuple[float, str]]:
        return {
            one.observed_property: (one.result_value, one.result_uom)
            for reported in self.lists(now)
            for one in reported.observation_array
        }

    def wind(self) -> tuple[float, float]:
        """Speed, m/s, and where it comes from, degrees."""
        values = self.values()
        assert (values["wind_speed"][1], values["wind_direction"][1]) == ("m/s", "deg")
        return values["wind_speed"][0], values["wind_direction"][0]


def test_a_hygrometer_measures_temperature_and_humidity() -> None:
    sensors = Sensors()
    sensors.receive(hygrometer(-3.25, 48.5))
    assert sensors.values() == {
        "air_temperature": (-3.25, "Cel"),
        "relative_humidity": (48.5, "%"),
    }


@pytest.mark.parametrize(
    ("name", "reported", "unit"),
    [
        ("temp_air", "air_temperature", "Cel"),
        ("hum_air", "relative_humidity", "%"),
        ("soil_moist", "soil_moisture", "%"),
        ("temp_soil", "soil_temperature", "Cel"),
        ("light", "illuminance", "lx"),
        ("leaf_wet", "leaf_wet", "1"),
    ],
)
def test_known_names_have_units_and_others_are_reported_as_they_are(
    name: str, reported: str, unit: str
) -> None:
    sensors = Sensors()
    sensors.receive(named(name, 12.5))
    assert sensors.values() == {reported: (12.5, unit)}


def test_a_whole_number_is_a_measurement_too() -> None:
    sensors = Sensors()
    sensors.receive(mavlink.MAVLink_named_value_int_message(1000, b"light", 54_000))
    assert sensors.values() == {"illuminance": (54_000.0, "lx")}


@pytest.mark.parametrize(
    ("north_m_s", "east_m_s", "from_deg"),
    [(-3.0, 0.0, 0.0), (0.0, -3.0, 90.0), (3.0, 0.0, 180.0), (0.0, 3.0, 270.0)],
)
def test_wind_is_reported_by_where_it_comes_from(
    north_m_s: float, east_m_s: float, from_deg: float
) -> None:
    sensors = Sensors()
    sensors.receive(wind_cov(north_m_s, east_m_s))
    speed_m_s, reported_deg = sensors.wind()
    assert speed_m_s == pytest.approx(3.0)
    assert reported_deg == pytest.approx(from_deg)


@pytest.mark.parametrize(("wind_m_s", "is_reported"), [(2.9, False), (6.9, False), (7.1, True)])
def test_a_wind_within_the_vehicles_accuracy_is_not_reported(
    wind_m_s: float, is_reported: bool
) -> None:
    sensors = Sensors()
    sensors.receive(wind_cov(wind_m_s, 0.0, accuracy_m_s=3.5))
    assert ("wind_speed" in sensors.values()) == is_reported


def test_still_air_comes_from_nowhere() -> None:
    sensors = Sensors()
    sensors.receive(wind_cov(0.0, 0.0))
    assert sensors.values() == {"wind_speed": (0.0, "m/s")}


def test_ardupilots_wind_is_the_same_quantity() -> None:
    sensors = Sensors()
    sensors.receive(mavlink.MAVLink_wind_message(-90.0, 4.0, 0.0))
    assert sensors.wind() == pytest.approx((4.0, 270.0))


def test_the_barometers_temperature_is_not_called_the_airs() -> None:
    sensors = Sensors()
    sensors.receive(mavlink.MAVLink_scaled_pressure_message(0, 939.5, 0.0, 4150))
    assert sensors.values() == {
        "air_pressure": (939.5, "hPa"),
        "barometer_temperature": (41.5, "Cel"),
    }


def test_resources_have_distinct_names_and_keep_them() -> None:
    sensors = Sensors()
    sensors.receive(hygrometer(number=0), hygrometer(number=1))
    sensors.receive(named("temp_air", 20.0), component=158)
    (reported,) = sensors.lists()
    names = [one.resource_id for one in reported.observation_array]
    assert names == [
        "urn:afc:uav:7:1:hygrometer0:air_temperature",
        "urn:afc:uav:7:1:hygrometer0:relative_humidity",
        "urn:afc:uav:7:1:hygrometer1:air_temperature",
        "urn:afc:uav:7:1:hygrometer1:relative_humidity",
        "urn:afc:uav:7:158:temp_air:air_temperature",
    ]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["temp_air", "anything"])
def test_what_is_no_number_is_not_reported(name: str, value: float) -> None:
    sensors = Sensors()
    sensors.receive(named(name, 20.0))
    sensors.receive(named(name, value))
    assert sensors.values() == {}


def test_a_sensors_invalid_values_are_not_reported() -> None:
    sensors = Sensors()
    sensors.receive(mavlink.MAVLink_hygrometer_sensor_message(0, 32_767, 65_535))
    assert sensors.values() == {}


def test_what_is_older_than_some_seconds_is_not_reported() -> None:
    sensors = Sensors()
    sensors.receive(named("light", 1.0))
    sensors.snapshot.time_s = 104.9
    assert sensors.values(now=0.5)
    sensors.snapshot.time_s = 105.1
    assert not sensors.values(now=0.5)


def test_a_simulated_vehicle_may_be_slow_but_a_lost_link_makes_everything_old() -> None:
    sensors = Sensors()
    sensors.receive(named("light", 1.0))
    assert sensors.values(now=29.0)
    assert not sensors.values(now=31.0)


def test_the_place_is_where_it_was_measured() -> None:
    sensors = Sensors()
    sensors.receive(named("light", 1.0))
    sensors.snapshot = at(101.0, latitude_deg=41.0)
    (reported,) = sensors.lists()
    assert (reported.latitude, reported.altitude) == (40.0, 5.0)
    assert (reported.vehicle_id, reported.sequence_number) == (7, 4)


def test_the_time_is_the_vehicles_own() -> None:
    sensors = Sensors()
    sensors.snapshot.take(mavlink.MAVLink_system_time_message(1_800_000_000_000_000, 50_000))
    sensors.receive(named("light", 1.0))
    sensors.snapshot.time_s = 103.0
    assert sensors.lists()[0].observation_array[0].result_time == 1_800_000_050


@pytest.mark.parametrize("utc_us", [0, 3_600_000_000, 4_102_444_800_000_000, 2**64 - 1])
def test_a_clock_that_was_not_set_is_ignored(utc_us: int) -> None:
    sensors = Sensors()
    sensors.snapshot.take(mavlink.MAVLink_system_time_message(utc_us, 50_000))
    sensors.receive(named("light", 1.0))
    assert sensors.lists()[0].observation_array[0].result_time == 0


def test_nothing_is_reported_of_an_unknown_place() -> None:
    sensors = Sensors()
    sensors.snapshot = Snapshot()
    sensors.receive(named("light", 1.0))
    assert sensors.lists() == []


def test_ten_make_a_list_and_names_without_end_are_not_kept() -> None:
    sensors = Sensors()
    sensors.receive(*(named(f"n{number}", 1.0) for number in range(200)))
    lists = sensors.lists()
    assert [len(reported.observation_array) for reported in lists] == [10, 10, 10, 10, 10, 10, 4]
    assert [reported.sequence_number for reported in lists] == list(range(4, 11))


@given(st.binary(min_size=10, max_size=10), st.floats(allow_nan=True, width=32))
def test_hostile_names_and_values_give_valid_observations(name: bytes, value: float) -> None:
    sensors = Sensors()
    try:
        message = received(mavlink.MAVLink_named_value_float_message(0, name, value))
    except UnicodeDecodeError:
        return
    for reading in readings(message):
        assert reading.value is None or math.isfinite(reading.value)
    sensors.observations.take(message, sensors.snapshot, 0.0)
    sensors.lists()


def test_other_messages_have_no_measurements() -> None:
    assert list(readings(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))) == []
