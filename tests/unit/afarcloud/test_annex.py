"""Every range of the `annex` profile: both bounds in, just outside refused."""

from afarcloud import annex, wire
from afarcloud.enumerations import CommandType
from afarcloud.faults import InvalidError
from afarcloud.plan import Plan
from tests.support.cases import failures
from tests.unit.afarcloud import documents

STEP = 1e-6
NOT_FLYABLE = {(CommandType.NAV_TAKEOFF, "altitude", 0)}
"""In the annex's range, and refused all the same: nothing takes off to the ground."""


def is_refused(kind: int, name: str, value: float) -> bool:
    mission = documents.mission_of((kind, {**documents.PARAMETERS[kind], name: value}))
    try:
        plan = wire.read(wire.Kind.PLAN, {"profile": "annex", "missions": [mission]})
    except InvalidError:
        return True
    assert isinstance(plan, Plan)
    return any(fault.path.endswith(name) for fault in annex.annex_faults(plan))


def cases() -> list[tuple[CommandType, str, float, bool]]:
    return [
        (kind, name, value, refused)
        for kind, ranges in annex.RANGES.items()
        for name, (low, high) in ranges.items()
        for value, refused in (
            (low, (kind, name, low) in NOT_FLYABLE),
            (high, False),
            (low - STEP, True),
            (high + STEP, True),
        )
    ]


def check_range(kind: CommandType, name: str, value: float, refused: bool) -> None:
    assert is_refused(kind.value, name, value) is refused


def test_both_bounds_are_accepted_and_values_just_outside_are_refused() -> None:
    assert failures(check_range, cases()) == []
