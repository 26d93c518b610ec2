"""Faults as people write them: files, lines, and what is wrong with them."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.fault_schedule import FIELDS, NEVER_US, Fault, FaultError, Kind
from sim.faults.notation import Clear, faults_of, read_faults, read_order

USED = "document: faults.toml, faults.json used"


def refusal(read: Callable[[], object]) -> str:
    """Why it was refused; anything but a refusal goes on."""
    try:
        read()
    except FaultError as error:
        return str(error)
    return USED


TOML = """
[[fault]]
kind = "motor_loss"
motor = 2
start_s = 20.0
duration_s = 5.0

[[fault]]
kind = "gps_loss"
start_s = 1
"""


def test_a_toml_file_and_a_json_file_say_the_same(tmp_path: Path) -> None:
    toml, as_json = tmp_path / "faults.toml", tmp_path / "faults.json"
    toml.write_text(TOML, encoding="utf-8")
    as_json.write_text(
        json.dumps(
            {
                "fault": [
                    {"kind": "motor_loss", "motor": 2, "start_s": 20, "end_s": 25},
                    {"kind": "gps_loss", "start_s": 1},
                ]
            }
        ),
        encoding="utf-8",
    )
    motor, gps = read_faults(toml)
    assert read_faults(as_json) == (motor, gps)
    assert (motor.kind, motor.start_us, motor.end_us) == (Kind.MOTOR_LOSS, 20_000_000, 25_000_000)
    assert dict(motor.values) == {"motor": 2, "efficiency": 0.0}
    assert (gps.start_us, gps.end_us) == (1_000_000, NEVER_US)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "one list named fault"),
        ("fault = 3", "one list named fault"),
        ("[[fault]]\nkind = 3", "fault 1: there is no fault 3"),
        ('[[fault]]\nkind = "gps_los"', "fault 1: there is no fault 'gps_los'"),
        ('[[fault]]\nkind = "gps_loss"\nstart_s = "a"', "start_s must be a number of seconds"),
        ('[[fault]]\nkind = "gps_loss"\nstart_s = nan', "start_s nan is outside"),
        ('[[fault]]\nkind = "gps_loss"\nend_s = 1\nduration_s = 1', "exclude each other"),
        ('[[fault]]\nkind = "motor_loss"\nmotor = "1"', "motor must be a finite number"),
        ("][", "faults.toml"),
    ],
)
def test_a_file_that_cannot_be_used_says_where_and_why(
    tmp_path: Path, text: str, words: str
) -> None:
    path = tmp_path / "faults.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FaultError, match=words):
        read_faults(path)


@given(contents=st.binary(max_size=60))
def test_no_bytes_in_a_file_do_worse_than_be_refused(
    tmp_path_factory: pytest.TempPathFactory, contents: bytes
) -> None:
    for name in ("faults.json", "faults.toml"):
        path = tmp_path_factory.getbasetemp() / name
        path.write_bytes(contents)
        assert name in refusal(partial(read_faults, path))


@given(
    document=st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(st.sampled_from(["fault", "kind", "motor", "start_s"]), inner)
        ),
        max_leaves=9,
    )
)
def test_no_document_does_worse_than_be_refused(document: object) -> None:
    assert refusal(lambda: faults_of(document, "document")).startswith("document: ")


@given(kind=st.sampled_from(list(Kind)), data=st.data(), now=st.integers(0, 10**9))
def test_what_is_written_in_a_line_is_what_is_read(
    kind: Kind, data: st.DataObject, now: int
) -> None:
    values = {
        name: float(data.draw(st.integers(int(-(-f.minimum // 1)), int(f.maximum // 1))))
        for name, f in FIELDS[kind].items()
    }
    line = " ".join((kind, *(f"{name}={value:g}" for name, value in values.items())))
    order = read_order(line, now)
    assert isinstance(order, Fault)
    assert order.kind is kind
    assert dict(order.values) == values
    assert order.start_us == now
    assert order.end_us == NEVER_US


def test_a_line_begins_now_and_may_end() -> None:
    order = read_order("gps_loss duration_s=2.5", 1_000_000)
    assert isinstance(order, Fault)
    assert (order.start_us, order.end_us) == (1_000_000, 3_500_000)


@pytest.mark.parametrize(
    ("line", "order"),
    [
        ("clear", Clear(None, None)),
        ("clear gps_loss", Clear(Kind.GPS_LOSS, None)),
        ("clear motor_loss motor=3", Clear(Kind.MOTOR_LOSS, 3)),
    ],
)
def test_faults_are_ended_by_a_line(line: str, order: Clear) -> None:
    assert read_order(line, 0) == order


@pytest.mark.parametrize(
    "line",
    ["", "gps", "clear gps", "clear gps_loss motor=1", "clear motor_loss motor=9", "gps_loss 5",
     "motor_loss motor=1 motor=2", "motor_loss motor=x"],
)  # fmt: skip
def test_a_line_that_is_no_order_is_refused(line: str) -> None:
    with pytest.raises(FaultError):
        read_order(line, 0)


@given(line=st.text(max_size=60))
def test_no_text_does_worse_than_be_refused(line: str) -> None:
    assert refusal(lambda: read_order(line, 0)) != ""
