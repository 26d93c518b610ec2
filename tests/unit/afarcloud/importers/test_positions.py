"""Parameters by place: the same plan, whichever way it is written."""

import itertools
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud import wire
from afarcloud.enumerations import CommandType
from afarcloud.faults import InvalidError
from afarcloud.importers.positions import PARAMETERS
from tests.support.cases import failures
from tests.unit.afarcloud import documents

DOUBLE_MAX = 1.7976931348623157e308
COMMAND_TYPES = sorted(documents.PARAMETERS)
WITH_A_PLACE = [kind for kind, names in PARAMETERS.items() if "latitude" in names]


def mission(command: dict[str, Any]) -> dict[str, Any]:
    """A bare mission of one command."""
    sent = documents.mission_of((11, {}))
    return {**sent, "command_array": [{"command_id": 1, **command}]}


def array_of(kind: int, order: str) -> list[Any]:
    """The good parameters of a command type as AFarCloud's planner writes them."""
    values = dict(documents.PARAMETERS[kind])
    if kind == CommandType.NAV_TRACK_SUBJECT:
        ((values["left"], values["top"]), (values["right"], values["bottom"])) = values["corners"]
    swapped = {"latitude": "longitude", "longitude": "latitude"} if order == "lon_lat" else {}
    return [float(values[swapped.get(name, name)]) for name in PARAMETERS[CommandType(kind)]]


def faults_of(document: dict[str, Any], kind: wire.Kind = wire.Kind.PLAN) -> list[tuple[str, str]]:
    with pytest.raises(InvalidError) as caught:
        wire.read(kind, document)
    return [(fault.path, fault.message) for fault in caught.value.faults]


@pytest.mark.parametrize("kind", COMMAND_TYPES)
def test_the_slot_of_a_command_type_holds_its_parameters(kind: int) -> None:
    named = wire.read(wire.Kind.PLAN, documents.mission_of((kind, documents.PARAMETERS[kind])))
    sent = mission({"command_type_id": kind, f"p{kind}": documents.PARAMETERS[kind]})
    assert wire.read(wire.Kind.PLAN, sent) == named


def check_array(kind: int, order: str) -> None:
    named = wire.read(wire.Kind.PLAN, documents.mission_of((kind, documents.PARAMETERS[kind])))
    sent = {"command_type_id": kind, "param_array": array_of(kind, order), "param_order": order}
    assert wire.read(wire.Kind.PLAN, mission(sent)) == named


def test_an_array_holds_the_parameters_in_either_order() -> None:
    cases = itertools.product(COMMAND_TYPES, ["lat_lon", "lon_lat"])
    assert failures(check_array, cases) == []


@pytest.mark.parametrize("kind", WITH_A_PLACE)
def test_an_array_with_a_place_must_say_its_order(kind: CommandType) -> None:
    sent = {"command_type_id": kind.value, "param_array": array_of(kind.value, "lat_lon")}
    assert faults_of(mission(sent)) == [
        (
            "command_array.0.param_order",
            "is required with param_array: lat_lon or lon_lat",
        )
    ]


@pytest.mark.parametrize("unset", [None, DOUBLE_MAX, -DOUBLE_MAX])
def test_a_number_that_was_not_given_is_left_to_the_autopilot(unset: float | None) -> None:
    values = [0.0, unset, 40.4434, -3.7382, 5.0]
    sent = {"command_type_id": 1, "param_array": values, "param_order": "lat_lon"}
    written = wire.write(wire.read(wire.Kind.PLAN, mission(sent)))
    parameters = written["missions"][0]["command_array"][0]["parameters"]
    assert "yaw_angle" not in parameters
    assert parameters["altitude"] == 5.0


def test_a_fault_in_an_array_names_its_place_in_the_array() -> None:
    values = [0.0, 0.0, -3.7382, 140.4434, 5.0]
    sent = {"command_type_id": 1, "param_array": values, "param_order": "lon_lat"}
    assert [path for path, _ in faults_of(mission(sent))] == ["command_array.0.param_array.3"]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1.0], "must have 5 numbers, not 1"),
        ("0,0,0,0,0", "must be an array of numbers"),
    ],
)
def test_an_array_of_another_length_is_refused(values: Any, message: str) -> None:
    sent = {"command_type_id": 1, "param_array": values, "param_order": "lat_lon"}
    assert faults_of(mission(sent)) == [("command_array.0.param_array", message)]


def test_parameters_are_given_once() -> None:
    sent = {"command_type_id": 11, "p11": {"landing": True}, "parameters": {"landing": False}}
    assert faults_of(mission(sent)) == [
        ("command_array.0.p11", "means the same as parameters: give one of them"),
        ("command_array.0.p11", "is not a known field"),
    ]


def test_the_slot_of_another_type_is_refused_unless_it_is_empty() -> None:
    command = {"command_type_id": 11, "p11": {"landing": True}}
    wire.read(wire.Kind.PLAN, mission({**command, "p1": None}))
    assert faults_of(mission({**command, "p1": {"altitude": 5}})) == [
        ("command_array.0.p1", "goes with command_type_id 1")
    ]


@given(st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists, max_leaves=8))
def test_whatever_an_array_holds_the_answer_is_a_plan_or_a_fault(values: Any) -> None:
    sent = {"command_type_id": 7, "param_array": values, "param_order": "lon_lat"}
    try:
        wire.read(wire.Kind.PLAN, mission(sent))
    except InvalidError as error:
        assert all(fault.path.startswith("command_array.0") for fault in error.faults)  # noqa: PT017  # both ends are good


EVENT = {"sequence_number": 1, "vehicle_id": 1}
PLACE = {**documents.PLACE, "altitude": 5.0}
PLACE_BY_LONGITUDE = [PLACE["longitude"], PLACE["latitude"], PLACE["altitude"]]


@pytest.mark.parametrize(
    ("sent", "named"),
    [
        ({"event_type_id": 1, "p1": PLACE}, {"event_type_id": 1, "abort": PLACE}),
        (
            {
                "event_type_id": 1,
                "p1": {"latitude": 0.0, "longitude": 0.0, "altitude": 0.0},
            },
            {"event_type_id": 1},
        ),
        ({"event_type_id": 2, "p1": None, "p2": None}, {"event_type_id": 2}),
        ({"event_type_id": 3, "p2": 2.5}, {"event_type_id": 3, "maximum_speed": 2.5}),
        (
            {"event_type_id": 3, "param_array": [2.5, 0.0, 0.0]},
            {"event_type_id": 3, "maximum_speed": 2.5},
        ),
        ({"event_type_id": 1, "param_array": [0.0, 0.0, 0.0]}, {"event_type_id": 1}),
        (
            {
                "event_type_id": 1,
                "param_array": PLACE_BY_LONGITUDE,
                "param_order": "lon_lat",
            },
            {"event_type_id": 1, "abort": PLACE},
        ),
    ],
)
def test_an_event_by_place(sent: dict[str, Any], named: dict[str, Any]) -> None:
    read = wire.read(wire.Kind.EVENT, {**EVENT, **sent})
    assert read == wire.read(wire.Kind.EVENT, {**EVENT, **named})


def test_an_events_place_must_say_its_order() -> None:
    sent = {**EVENT, "event_type_id": 1, "param_array": PLACE_BY_LONGITUDE}
    assert [path for path, _ in faults_of(sent, wire.Kind.EVENT)] == ["param_order"]


def test_a_fault_of_an_event_names_the_slot() -> None:
    sent = {**EVENT, "event_type_id": 3, "p2": 1_000.0}
    assert [path for path, _ in faults_of(sent, wire.Kind.EVENT)] == ["p2"]
