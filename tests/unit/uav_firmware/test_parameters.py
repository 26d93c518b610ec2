"""Bounds and locks of the whole vehicle's parameters, as a ground station meets them."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.support import parameter_table
from uav_firmware.parameters import (
    ParameterLockedError,
    ParameterRangeError,
    Registry,
    param,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SomeParams:
    share: float = param("A_SHARE", 0.2, unit="1", minimum=0.1, maximum=0.3, short="A share")
    place: float = param(
        "A_PLACE", 0.2, unit="m", minimum=-1.0, maximum=1.0, short="Of a rotor",
        locked_while_armed=True,
    )  # fmt: skip
    order: int = param("AN_ORDER", 0, unit="1", minimum=0, maximum=1, short="To do something")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Registry:
    """Give the registry of the whole vehicle."""
    return parameter_table.autopilot(tmp_path_factory.mktemp("vehicle")).registry


def some() -> Registry:
    registry = Registry()
    registry.add(SomeParams)
    return registry


def on_the_wire(value: float) -> float:
    """A value as PARAM_SET carries it."""
    carried: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return carried


def test_every_parameter_takes_its_own_bounds_and_nothing_beyond(whole: Registry) -> None:
    for name in whole.names():
        declaration = whole.declaration(name)
        if declaration.is_integer:
            continue
        for bound, outwards in ((declaration.minimum, -np.inf), (declaration.maximum, np.inf)):
            whole.set(name, on_the_wire(bound))
            whole.set(name, bound)
            beyond = float(np.nextafter(np.float32(bound), np.float32(outwards)))
            with pytest.raises(ParameterRangeError):
                whole.set(name, beyond)
        whole.set(name, declaration.default)


def test_a_value_too_large_for_four_bytes_is_out_of_range() -> None:
    with pytest.raises(ParameterRangeError):
        some().set("A_SHARE", 1e300)


def test_what_describes_the_vehicle_cannot_be_changed_while_it_is_armed() -> None:
    registry = some()
    registry.armed = True
    with pytest.raises(ParameterLockedError, match="A_PLACE: cannot be changed while armed"):
        registry.set("A_PLACE", 0.5)
    registry.set("A_PLACE", on_the_wire(0.2))  # What it is already, such as from a file of all
    registry.set("A_SHARE", 0.15)
    registry.armed = False
    registry.set("A_PLACE", 0.5)
    assert registry.get("A_PLACE") == 0.5


def test_a_group_that_is_declared_later_is_a_change_for_those_who_wait_for_it(
    tmp_path: Path,
) -> None:
    """The drag is the commander's, which is built after the estimator that flies by it."""
    registry = Registry()
    seen = registry.version
    registry.add(SomeParams)
    assert registry.version != seen
    autopilot = parameter_table.autopilot(tmp_path)
    autopilot.scheduler.step()
    assert autopilot.estimator.estimator.drag.drag is not None


def test_an_order_that_was_carried_out_is_put_back_and_announced_once() -> None:
    registry = some()
    registry.set("AN_ORDER", 1)
    version = registry.version
    registry.put_back("AN_ORDER")
    assert registry.get("AN_ORDER") == 0
    assert registry.version > version
    assert registry.take_put_back() == ["AN_ORDER"]
    assert registry.take_put_back() == []


def test_stored_values_at_their_bounds_are_loaded_again() -> None:
    registry = some()
    registry.set("A_SHARE", on_the_wire(0.3))
    again = some()
    assert again.load(registry.changed()) == []
    assert again.get("A_SHARE") == registry.get("A_SHARE")


@pytest.mark.parametrize("name", ["FD_FAIL_R", "FD_FAIL_P"])
def test_no_angle_that_a_gust_exceeds_counts_as_a_lost_attitude(whole: Registry, name: str) -> None:
    for refused in (1.0, 5.0, 29.9):
        with pytest.raises(ParameterRangeError, match="neither 0 nor at least 30"):
            whole.set(name, refused)
    for taken in (0.0, 30.0, 60.0):
        whole.set(name, taken)


@pytest.mark.parametrize("name", ["FD_FAIL_R", "FD_FAIL_P", "FD_FAIL_R_TTRI", "FD_FAIL_P_TTRI"])
def test_what_makes_an_attitude_lost_cannot_be_changed_while_armed(
    whole: Registry, name: str
) -> None:
    other = whole.declaration(name).maximum
    whole.armed = True
    with pytest.raises(ParameterLockedError):
        whole.set(name, other)
    whole.armed = False
    whole.set(name, other)
    whole.set(name, whole.declaration(name).default)
