"""Every logged message, value by value, as pyulog reads it."""

import io
import math
import re
import struct
from typing import Any, get_type_hints

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no types

from tests.support import pages
from uav_firmware.modules.logger import ulog
from uav_firmware.modules.logger.collector import recorder
from uav_firmware.modules.logger.states import TRANSITIONS
from uav_firmware.modules.logger.streams import STREAMS, Stream
from uav_firmware.msg.estimate import AidSource, EstimateResets
from uav_firmware.msg.sensors import SensorBaro, SensorGps
from uav_firmware.msg.status import LandedState, NavigationState
from uav_firmware.topics import Topics

PAGE = pages.text("reference/flight-log.md")
NUMBER = st.floats(-1e6, 1e6, width=32)
SMALL = st.integers(0, 200)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
VALUES: dict[Any, st.SearchStrategy[Any]] = {
    int: SMALL,
    int | None: st.none() | SMALL,
    bool: st.booleans(),
    float: NUMBER,
    NavigationState: st.sampled_from(NavigationState),
    LandedState: st.sampled_from(LandedState),
    tuple[float, float, float]: VECTOR,
    tuple[float, float, float, float]: st.tuples(NUMBER, NUMBER, NUMBER, NUMBER),
    AidSource: st.sampled_from(AidSource),
    EstimateResets: st.builds(
        EstimateResets, SMALL, SMALL, SMALL, SMALL, SMALL, VECTOR, VECTOR, NUMBER
    ),
    tuple[int, ...]: st.just(()),  # A list of numbers is not logged
}


def message_type(stream: Stream) -> Any:
    """The class of what a stream's topic carries."""
    topics = Topics()
    name = next(name for name in Topics.__slots__ if stream.topic(topics) is getattr(topics, name))
    return get_type_hints(Topics)[name].__args__[0]


def instances(kind: Any) -> st.SearchStrategy[Any]:
    plain = get_type_hints(kind.__init__)  # Of a NamedTuple it has none
    plain.pop("return", None)
    hints = plain or get_type_hints(kind)
    given_ranges = {
        "capacity_ah": st.floats(0.0, 1e6, width=32),
        "pressure_pa": st.floats(1e4, 1.1e5, width=32),
        "temperature_c": st.floats(-40.0, 85.0),
        "latitude_deg": st.floats(-90.0, 90.0),
        "longitude_deg": st.floats(-180.0, 180.0),
    }
    return st.builds(
        kind, **{name: given_ranges.get(name, VALUES[hint]) for name, hint in hints.items()}
    )


def read(stream: Stream, value: Any) -> dict[str, float]:
    """What pyulog reads of one record."""
    message = stream.message
    parts = (
        ulog.header(0),
        ulog.format_definition(message.name, message.fields),
        ulog.subscription(3, message.name),
        recorder(3, message)(value),
    )
    data = ULog(io.BytesIO(b"".join(parts))).get_dataset(message.name).data
    return {name: column[0] for name, column in data.items()}


def names(stream: Stream) -> list[str]:
    return [
        field.name if field.length == 1 else f"{field.name}[{index}]"
        for field in stream.message.fields
        for index in range(field.length)
    ]


def as_stored(value: float, kind: str) -> float:
    """What is left of a number in four bytes."""
    if kind != "float":
        return value
    stored: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return stored


@pytest.mark.parametrize("stream", STREAMS, ids=lambda stream: stream.message.name)
def test_every_field_is_read_back_by_name(stream: Stream) -> None:
    kinds = [field.kind for field in stream.message.fields for _ in range(field.length)]

    @settings(max_examples=20)
    @given(instances(message_type(stream)))
    def reads_back(value: Any) -> None:
        expected = [
            as_stored(number, kind)
            for number, kind in zip(stream.message.values(value), kinds, strict=True)
        ]
        found = read(stream, value)
        assert list(found) == ["timestamp", *(n for n in names(stream) if n != "timestamp")]
        for name, number in zip(names(stream), expected, strict=True):
            assert found[name] == number or (math.isnan(number) and math.isnan(found[name]))
        assert found["timestamp"] == value.time_us

    reads_back()


def by_name(name: str) -> Stream:
    return next(stream for stream in STREAMS if stream.message.name == name)


def test_barometric_altitude_decreases_with_pressure() -> None:
    stream = by_name("vehicle_air_data")
    low = read(stream, SensorBaro(0, 101_325.0, 15.0))
    high = read(stream, SensorBaro(0, 95_000.0, 15.0))
    assert low["baro_alt_meter"] == pytest.approx(0.0, abs=0.01)
    assert high["baro_alt_meter"] == pytest.approx(540.0, abs=2.0)
    assert low["rho"] == pytest.approx(1.225, abs=0.001)


def gps(**changes: Any) -> SensorGps:
    return SensorGps(
        time_us=1,
        time_utc_us=2,
        latitude_deg=40.4434,
        longitude_deg=-3.7382,
        altitude_amsl_m=650.5,
        velocity_ned=(3.0, 4.0, -1.0),
        horizontal_accuracy_m=0.5,
        vertical_accuracy_m=0.8,
        speed_accuracy_m_s=0.1,
        fix_type=3,
        satellites_used=14,
        hdop=0.7,
        vdop=0.9,
    )._replace(**changes)


def test_gps_position_is_logged_in_old_and_new_units() -> None:
    found = read(by_name("vehicle_gps_position"), gps())
    assert found["latitude_deg"] == 40.4434
    assert found["lat"] == 404_434_000
    assert found["lon"] == -37_382_000
    assert found["alt"] == 650_500


def test_gps_speed_and_course_match_its_velocity() -> None:
    found = read(by_name("vehicle_gps_position"), gps())
    assert found["vel_m_s"] == 5.0
    assert found["cog_rad"] == pytest.approx(math.atan2(4.0, 3.0))


def test_thrust_is_negative_upwards() -> None:
    thrust = by_name("vehicle_thrust_setpoint")
    value = message_type(thrust)(time_us=0, torque_frd=(0.0, 0.0, 0.0), thrust=0.5)
    assert read(thrust, value)["xyz[2]"] == -0.5


def test_unused_motors_are_nan() -> None:
    stream = by_name("actuator_motors")
    found = read(stream, message_type(stream)(time_us=0, control=(0.0, 0.1, 0.2, 0.3)))
    assert found["control[0]"] == 0.0
    assert math.isnan(found["control[4]"])


def test_message_names_are_unique() -> None:
    listed = [stream.message.name for stream in STREAMS]
    assert len(set(listed)) == len(listed)


def test_the_page_lists_every_rate() -> None:
    rows = re.findall(r"^\| `([a-z_]+)` \| (\d+) \| (\d+) \|$", PAGE, re.MULTILINE)
    table = [(stream.message.name, stream.rate_hz, stream.high_rate_hz) for stream in STREAMS]
    assert [(name, int(rate), int(high)) for name, rate, high in rows] == table


def test_the_page_draws_every_transition() -> None:
    for state, event in TRANSITIONS:
        assert state.name in PAGE
        assert event.name in PAGE
