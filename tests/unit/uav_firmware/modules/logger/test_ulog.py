"""The encoder against pyulog, the reader that PX4's developers use."""

import contextlib
import io
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no types

from uav_firmware.modules.logger import ulog

FINITE = st.floats(width=32, allow_nan=False)
WORDS = st.text(min_size=1, max_size=60).filter(lambda text: text.isprintable())

KINDS = {
    "int8_t": st.integers(-(2**7), 2**7 - 1),
    "uint8_t": st.integers(0, 2**8 - 1),
    "int16_t": st.integers(-(2**15), 2**15 - 1),
    "uint16_t": st.integers(0, 2**16 - 1),
    "int32_t": st.integers(-(2**31), 2**31 - 1),
    "uint32_t": st.integers(0, 2**32 - 1),
    "int64_t": st.integers(-(2**63), 2**63 - 1),
    "uint64_t": st.integers(0, 2**64 - 1),
    "float": FINITE,
    "double": st.floats(allow_nan=False),
    "bool": st.booleans(),
}


def read(*parts: bytes) -> ULog:
    return ULog(io.BytesIO(ulog.header(0) + b"".join(parts)))


def record(message_fields: tuple[ulog.Field, ...], identifier: int, *values: float) -> bytes:
    layout = ulog.record_layout(message_fields)
    return layout.pack(layout.size - 3, ord("D"), identifier, *values)


@pytest.mark.first_case
@pytest.mark.parametrize("kind", KINDS)
def test_values_of_every_type_are_read_back(kind: str) -> None:
    layout = ulog.fields(f"uint64_t timestamp; {kind} one; {kind}[3] three")

    @given(st.tuples(*(KINDS[kind] for _ in range(4))))
    def reads_back(values: tuple[float, ...]) -> None:
        log = read(
            ulog.format_definition("thing", layout),
            ulog.subscription(7, "thing"),
            record(layout, 7, 1234, *values),
        )
        data = log.get_dataset("thing").data
        found = (data["one"][0], *(data[f"three[{index}]"][0] for index in range(3)))
        assert data["timestamp"][0] == 1234
        assert found == values

    reads_back()


def test_nan_stays_nan() -> None:
    layout = ulog.fields("uint64_t timestamp; float x")
    log = read(
        ulog.format_definition("thing", layout),
        ulog.subscription(0, "thing"),
        record(layout, 0, 1, math.nan),
    )
    assert math.isnan(log.get_dataset("thing").data["x"][0])


@given(st.integers(0, 2**64 - 1))
def test_the_header_contains_the_start_time(time_us: int) -> None:
    assert ULog(io.BytesIO(ulog.header(time_us))).start_timestamp == time_us


@given(WORDS, st.integers(-(2**31), 2**32 - 1))
def test_information_is_read_back(text: str, number: int) -> None:
    log = read(ulog.information("words", text), ulog.information("count", number))
    assert log.msg_info_dict == {"words": text, "count": number}


@given(st.integers(-(2**31), 2**31 - 1), FINITE)
def test_parameters_keep_value_and_type(whole: int, fraction: float) -> None:
    log = read(ulog.parameter("A_WHOLE", whole), ulog.parameter("A_FRACTION", fraction))
    assert log.initial_parameters == {"A_WHOLE": whole, "A_FRACTION": fraction}
    assert isinstance(log.initial_parameters["A_WHOLE"], int)


def test_the_default_of_a_parameter_is_logged_with_its_value() -> None:
    log = read(ulog.parameter("MPC_XY_P", 0.5), ulog.parameter_default("MPC_XY_P", 0.75))
    assert log.has_default_parameters
    assert log.initial_parameters["MPC_XY_P"] == 0.5
    assert log.get_default_parameters(0) == {"MPC_XY_P": 0.75}


def test_a_parameter_that_changes_in_flight_keeps_its_first_value() -> None:
    layout = ulog.fields("uint64_t timestamp; float x")
    log = read(
        ulog.format_definition("thing", layout),
        ulog.parameter("P", 1),
        ulog.subscription(0, "thing"),
        record(layout, 0, 500, 0.0),
        ulog.parameter("P", 2),
    )
    assert log.initial_parameters == {"P": 1}
    assert log.changed_parameters == [(500, "P", 2)]


@given(WORDS, st.integers(0, 7), st.integers(0, 2**63))
def test_a_text_keeps_severity_and_time(text: str, severity: int, time_us: int) -> None:
    (found,) = read(
        ulog.subscription(0, "thing"), ulog.text(severity, time_us, text)
    ).logged_messages
    assert (found.message, found.timestamp) == (text, time_us)
    assert found.log_level == ord(str(severity))


@given(st.text(max_size=5000), st.integers())
def test_any_text_is_encoded(text: str, severity: int) -> None:
    encoded = ulog.text(severity, 0, text)
    assert struct.unpack_from("<H", encoded)[0] == len(encoded) - 3
    assert len(encoded) <= ulog.TEXT_MAX + 12


def test_readers_find_the_synchronisation_bytes() -> None:
    assert ulog.synchronisation()[3:] == ULog.SYNC_BYTES


@pytest.mark.parametrize(
    "declaration", ["", "float", "float[] x", "long x", "float x y", "float[3]x", "char[4] name"]
)
def test_an_invalid_field_is_named_in_the_error(declaration: str) -> None:
    with pytest.raises(ulog.FormatError, match="is not a field"):
        ulog.fields(declaration)


@given(st.integers(0, 10_000))
def test_a_file_cut_anywhere_is_readable_up_to_there(cut: int) -> None:
    layout = ulog.fields("uint64_t timestamp; float[4] q")
    whole = b"".join(
        (
            ulog.header(0),
            ulog.format_definition("thing", layout),
            ulog.parameter("P", 3),
            ulog.subscription(0, "thing"),
            *(record(layout, 0, number, 1.0, 0.0, 0.0, 0.0) for number in range(20)),
        )
    )
    size = ulog.record_layout(layout).size
    data_begins = len(whole) - 20 * size
    part = whole[: max(16, min(cut, len(whole)))]
    with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what it thinks
        log = ULog(io.BytesIO(part))
    complete = max(0, len(part) - data_begins) // size
    found = log.get_dataset("thing").data["timestamp"] if complete else []
    assert list(found) == list(range(complete))
