"""The airframe put in short: it flies as the bundled one."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import jsbsim
import pytest

from sim.config import SimulationConfig
from sim.physics import airframe
from sim.physics.airframe import AIRFRAME, AirframeFileError, extended_airframe
from sim.physics.quadrotor import Quadrotor
from sim.physics.truth import Motors, Truth
from tests.support.messages import said

BUNDLED = Path(jsbsim.get_default_root_dir()) / "aircraft"
CLIMB: Motors = (0.7, 0.7, 0.7, 0.7)
ROLL_AND_TURN: Motors = (0.55, 0.66, 0.64, 0.58)


def flight() -> Sequence[Truth]:
    """Climb, roll and turn in wind until it hits the ground."""
    quadrotor = Quadrotor(SimulationConfig())
    quadrotor.set_wind((3.0, -4.0, 0.5))
    track = []
    for number in range(600):
        quadrotor.command(CLIMB if number < 300 else ROLL_AND_TURN)
        quadrotor.set_rotor_effects(quadrotor.truth(0))
        quadrotor.advance(2)
        track.append(quadrotor.truth(number))
    return track


def test_put_in_short_it_flies_the_same_to_the_last_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    short = flight()
    monkeypatch.setattr(airframe, "SHORTENED", {})
    assert said(short) == said(flight())
    assert max(truth.height_above_home_m for truth in short) > 1.0


@pytest.mark.parametrize("element", airframe.SHORTENED)
def test_an_airframe_that_lacks_an_element_is_refused_with_its_name(
    tmp_path: Path, element: str
) -> None:
    copy = tmp_path / AIRFRAME
    shutil.copytree(BUNDLED / AIRFRAME, copy)
    description = copy / f"{AIRFRAME}.xml"
    description.chmod(0o600)
    description.write_text(description.read_text().replace(element, ""))
    with pytest.raises(AirframeFileError, match=element), extended_airframe(tmp_path):
        pass


def test_the_installed_airframe_stays_as_it_is() -> None:
    before = (BUNDLED / AIRFRAME / f"{AIRFRAME}.xml").read_bytes()
    Quadrotor(SimulationConfig())
    assert (BUNDLED / AIRFRAME / f"{AIRFRAME}.xml").read_bytes() == before
