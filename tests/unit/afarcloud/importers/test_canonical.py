"""What only the annex allows becomes the nearest thing that can be flown."""

from typing import Any

import pytest

from afarcloud import wire
from afarcloud.faults import InvalidError
from tests.unit.afarcloud import documents


def parameters(kind: int, profile: str, **change: Any) -> dict[str, Any]:
    """A command's parameters as read under a profile."""
    mission = documents.mission_of((kind, {**documents.PARAMETERS[kind], **change}))
    plan = wire.read(wire.Kind.PLAN, {"profile": profile, "missions": [mission]})
    read: dict[str, Any] = wire.write(plan)["missions"][0]["command_array"][0]["parameters"]
    return read


@pytest.mark.parametrize(
    ("kind", "name", "sent", "read"),
    [
        (3, "acceptance_radius", 0, 0.1),
        (2, "precision_land_mode", 0, 0),
        (2, "precision_land_mode", 1.0, 1),
        (2, "precision_land_mode", 2, 2),
        (2, "precision_land_mode", 0.5, 1),
        (2, "precision_land_mode", 10, 1),
        (9, "corners", [0, 1], [[0.0, 0.0], [1.0, 1.0]]),
    ],
)
def test_an_annex_value_is_read(kind: int, name: str, sent: Any, read: Any) -> None:
    assert parameters(kind, "annex", **{name: sent})[name] == read


@pytest.mark.parametrize(
    ("kind", "name", "sent"),
    [
        (3, "acceptance_radius", -0.001),
        (2, "precision_land_mode", 10.001),
        (2, "precision_land_mode", -1),
        (9, "corners", [0, 2]),
    ],
)
def test_outside_the_annex_it_is_refused(kind: int, name: str, sent: Any) -> None:
    with pytest.raises(InvalidError):
        parameters(kind, "annex", **{name: sent})


@pytest.mark.parametrize(
    ("kind", "name", "sent"),
    [(3, "acceptance_radius", 0), (2, "precision_land_mode", 0.5), (9, "corners", [0, 1])],
)
def test_under_the_field_profile_it_is_refused(kind: int, name: str, sent: Any) -> None:
    with pytest.raises(InvalidError):
        parameters(kind, "field", **{name: sent})
