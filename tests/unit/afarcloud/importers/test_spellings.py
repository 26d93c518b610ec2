"""What other systems write is read as what they mean, and faults name what they wrote."""

from typing import Any

import pytest

from afarcloud import wire
from afarcloud.faults import InvalidError
from afarcloud.importers.spellings import ENVELOPES, SPELLINGS
from tests.unit.afarcloud import documents

KINDS_WITH_A_MISPRINT = ["pose", "battery", "observation", "mission_report"]


def misspelt(document: Any, wrong: str, right: str) -> Any:
    """Write one name of a document wrongly, wherever it stands."""
    if isinstance(document, list):
        return [misspelt(one, wrong, right) for one in document]
    if not isinstance(document, dict):
        return document
    return {
        wrong if name == right else name: misspelt(one, wrong, right)
        for name, one in document.items()
    }


def every_document() -> list[tuple[wire.Kind, Any]]:
    """A good document of every kind, and a mission with all eleven commands."""
    mission = documents.mission_of(*documents.PARAMETERS.items())
    reports = [(wire.Kind(kind), report) for kind, report in documents.REPORTS.items()]
    return [(wire.Kind.PLAN, mission), *reports]


@pytest.mark.parametrize(("wrong", "right"), SPELLINGS.items())
def test_a_misprinted_name_means_the_right_one(wrong: str, right: str) -> None:
    changed = 0
    for kind, document in every_document():
        sent = misspelt(document, wrong, right)
        changed += sent != document
        assert wire.read(kind, sent) == wire.read(kind, document)
    assert changed


@pytest.mark.parametrize(("wrong", "right"), ENVELOPES.items())
def test_a_misprinted_envelope_is_opened(wrong: str, right: str) -> None:
    document = {**documents.REPORTS, "event": documents.EVENTS[1]}[right]
    assert wire.read(wire.Kind(right), {wrong: document}) == wire.read(wire.Kind(right), document)


def test_a_fault_names_the_field_as_it_was_written() -> None:
    mission = documents.mission_of((7, {**documents.PARAMETERS[7], "radius": 4.0}))
    sent = misspelt(misspelt(mission, "radious", "radius"), "commands", "command_array")
    with pytest.raises(InvalidError) as caught:
        wire.read(wire.Kind.PLAN, sent)
    assert [fault.path for fault in caught.value.faults] == ["commands.0.parameters.radious"]


def test_two_spellings_of_one_field_are_refused() -> None:
    sent = {**documents.mission_of((11, {})), "maximum_linear_speed": 3.0}
    with pytest.raises(InvalidError) as caught:
        wire.read(wire.Kind.PLAN, sent)
    assert [(fault.path, fault.message) for fault in caught.value.faults] == [
        ("maximum_linear_speed", "means the same as maximum_speed: give one of them")
    ]


def test_a_document_nested_without_end_is_refused() -> None:
    nested: dict[str, Any] = {}
    for _ in range(5_000):
        nested = {"frame": nested}
    with pytest.raises(InvalidError, match="nests too deep"):
        wire.read(wire.Kind.IMAGE, nested)
