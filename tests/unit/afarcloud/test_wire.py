import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud import wire
from afarcloud.enumerations import CommandType
from afarcloud.faults import Fault, InvalidError, SyntaxFaultError
from afarcloud.plan import Plan
from tests.unit.afarcloud import documents


def faults_of(document: Any, kind: wire.Kind = wire.Kind.PLAN) -> tuple[Fault, ...]:
    with pytest.raises(InvalidError) as caught:
        wire.read(kind, document)
    return caught.value.faults


def paths_of(document: Any, kind: wire.Kind = wire.Kind.PLAN) -> list[str]:
    return [fault.path for fault in faults_of(document, kind)]


ALL_KINDS = [
    (wire.Kind.PLAN, documents.PLAN),
    *((wire.Kind.EVENT, event) for event in documents.EVENTS),
    *((wire.Kind(kind), body) for kind, body in documents.REPORTS.items()),
]


@pytest.mark.parametrize(("kind", "body"), ALL_KINDS)
def test_envelope_and_bare_form_read_alike(kind: wire.Kind, body: dict[str, Any]) -> None:
    assert wire.read(kind, {kind.value: body}) == wire.read(kind, body)


@pytest.mark.parametrize(("kind", "body"), ALL_KINDS)
def test_what_is_written_reads_back(kind: wire.Kind, body: dict[str, Any]) -> None:
    model = wire.read(kind, body)
    assert wire.read(kind, json.loads(json.dumps(wire.write(model)))) == model


@pytest.mark.parametrize(("kind", "body"), ALL_KINDS)
def test_every_field_sent_is_written_again(kind: wire.Kind, body: dict[str, Any]) -> None:
    written = wire.write(wire.read(kind, body))
    assert {key for key, value in body.items() if value is not None} <= written.keys()


def test_every_kind_has_a_model_and_the_cloud_gets_seven() -> None:
    assert set(wire.MODELS) == set(wire.Kind)
    assert len(wire.TELEMETRY) == 7


def test_a_bare_mission_is_a_plan_of_one_mission() -> None:
    mission = documents.PLAN["missions"][0]
    plan = wire.read(wire.Kind.PLAN, mission)
    assert isinstance(plan, Plan)
    assert len(plan.missions) == 1
    assert plan.missions[0].mission_id == 1201


def test_a_fault_in_a_bare_mission_is_named_as_it_was_sent() -> None:
    mission = documents.mission_of((1, {**documents.PARAMETERS[1], "latitude": 91}))
    assert paths_of(mission) == ["command_array.0.parameters.latitude"]


@pytest.mark.parametrize("kind", list(CommandType))
def test_all_eleven_commands_are_read(kind: CommandType) -> None:
    plan = wire.read(wire.Kind.PLAN, documents.mission_of((kind, documents.PARAMETERS[kind])))
    assert isinstance(plan, Plan)
    (command,) = plan.missions[0].command_array
    assert command.command_type_id is kind


@pytest.mark.parametrize(
    "number", [0, 12, -1, True, "1", 1.5, None, [], {}, math.nan, math.inf, 10**400]
)
def test_an_unknown_command_type_is_named(number: Any) -> None:
    document = documents.plan()
    document["missions"][1]["command_array"][1]["command_type_id"] = number
    assert paths_of(document) == ["missions.1.command_array.1.command_type_id"]


def test_a_missing_command_type_is_named() -> None:
    document = documents.plan()
    del document["missions"][0]["command_array"][2]["command_type_id"]
    assert paths_of(document) == ["missions.0.command_array.2.command_type_id"]


def test_several_faults_are_told_at_once() -> None:
    document = documents.plan()
    document["missions"][0]["command_array"][1]["parameters"]["latitude"] = 91
    document["missions"][1]["maximum_speed"] = -1
    document["surprise"] = 1
    assert sorted(paths_of(document)) == [
        "missions.0.command_array.1.parameters.latitude",
        "missions.1.maximum_speed",
        "surprise",
    ]


def test_an_empty_mission_carries_afarclouds_code() -> None:
    document = documents.plan()
    document["missions"][0]["command_array"] = []
    (fault,) = faults_of(document)
    assert (fault.path, fault.code, fault.name) == (
        "missions.0.command_array",
        404,
        "NO_COMMANDS",
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, "5", True, None, [], 10**400])
def test_a_number_is_a_finite_json_number(bad: Any) -> None:
    document = documents.plan()
    document["missions"][0]["command_array"][0]["parameters"]["altitude"] = bad
    assert paths_of(document) == ["missions.0.command_array.0.parameters.altitude"]


def test_the_input_is_never_echoed() -> None:
    document = documents.plan()
    document["name"] = {"secret": "hunter2"}
    assert "hunter2" not in str(faults_of(document))


@pytest.mark.parametrize("document", [None, 1, "plan", [], [documents.PLAN], True])
def test_a_document_that_is_no_object_is_refused(document: Any) -> None:
    assert paths_of(document) == [""]


@pytest.mark.parametrize("raw", [b"", b"{", b"\xff\xfe", b"[" * 200_000, b'{"a":}', b"\x00"])
def test_bytes_that_are_no_json_are_a_syntax_fault(raw: bytes) -> None:
    with pytest.raises(SyntaxFaultError):
        wire.read_plan(raw)


@pytest.mark.parametrize(
    ("raw", "fault"),
    [
        (b"[" * 200_000, "arrays and objects nest too deep"),
        (b"[" + b"7" * 5_000 + b"]", "a number has more than 4300 digits"),
    ],
)
def test_json_that_is_too_large_to_read_is_named_in_plain_words(raw: bytes, fault: str) -> None:
    with pytest.raises(SyntaxFaultError) as caught:
        wire.read_plan(raw)
    assert [one.message for one in caught.value.faults] == [fault]


def test_nan_in_bytes_is_refused_with_its_path() -> None:
    raw = json.dumps(documents.PLAN).replace("40.44352", "NaN").encode()
    with pytest.raises(InvalidError) as caught:
        wire.read_plan(raw)
    assert [f.path for f in caught.value.faults] == [
        "missions.0.command_array.1.parameters.latitude"
    ]


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["missions", "command_array", "parameters", "plan", "vehicle_id"])
            | st.text(max_size=4),
            inner,
            max_size=4,
        )
    ),
    max_leaves=20,
)


@given(st.sampled_from(list(wire.Kind)), json_values)
def test_any_json_is_read_or_refused_by_name(kind: wire.Kind, document: Any) -> None:
    try:
        wire.read(kind, document)
    except InvalidError as error:
        assert error.faults  # noqa: PT017  # either outcome is right


@given(st.binary(max_size=64))
def test_any_bytes_are_read_or_refused_by_name(raw: bytes) -> None:
    with pytest.raises((InvalidError, SyntaxFaultError)):
        wire.read_plan(raw)


@given(st.floats(min_value=-180, max_value=360, exclude_max=True))
def test_a_yaw_is_kept_between_0_and_360(yaw_deg: float) -> None:
    pose = wire.read(wire.Kind.POSE, {**documents.REPORTS["pose"], "yaw": yaw_deg})
    kept = wire.write(pose)["yaw"]
    assert 0 <= kept < 360
    assert math.isclose(math.cos(math.radians(kept - yaw_deg)), 1, abs_tol=1e-9)
