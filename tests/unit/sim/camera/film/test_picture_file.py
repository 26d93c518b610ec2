"""Files: what is written into them, and that they are whole or not there."""

import io
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from sim.camera.film.metadata import angles
from sim.camera.film.orders import EstimatedPose, OrderError, from_line, to_line
from sim.camera.film.picture_file import write_picture
from sim.physics.truth import quaternion_from_euler
from tests.unit.sim.camera.shots import order, pose, taken
from tests.unit.sim.camera.surveyor import read

DOWN = pose(5.0, 30.0, 20.0, -90.0, 0.0)


@given(st.floats(0.0, 359.9), st.floats(-89.99, 89.99), st.floats(-40.0, 40.0))
def test_angles_come_back(yaw: float, pitch: float, roll: float) -> None:
    q = quaternion_from_euler(*(math.radians(each) for each in (roll, pitch, yaw)))
    found = angles(q)
    again = quaternion_from_euler(
        math.radians(found.roll), math.radians(found.pitch), math.radians(found.yaw)
    )
    away = 1.0 - abs(sum(a * b for a, b in zip(q, again, strict=True)))
    steep = abs(pitch) > 88.8
    assert away < (0.2 if steep else 1e-9)  # Straight down, roll is taken as zero
    assert found.pitch == pytest.approx(pitch, abs=1e-6)


@given(st.floats(0.0, 359.9))
def test_straight_down_the_top_of_the_picture_is_the_yaw(yaw: float) -> None:
    found = angles(quaternion_from_euler(0.0, math.radians(-90.0), math.radians(yaw)))
    assert abs((found.yaw - yaw + 180.0) % 360.0 - 180.0) < 1e-6
    assert found.roll == 0.0


def test_what_is_written_is_what_the_vehicle_believes(tmp_path: Path) -> None:
    survey, pixels = read(taken(tmp_path, pose(5.0, 30.0, 20.0, -60.0, 215.0)))
    assert survey.altitude_m == pytest.approx(670.0, abs=1e-3)
    assert survey.yaw_deg % 360.0 == pytest.approx(215.0, abs=1e-3)
    assert survey.pitch_deg == pytest.approx(-60.0)
    assert survey.roll_deg == pytest.approx(0.0)
    assert survey.focal_px == pytest.approx(640 * 4.5 / 6.3, rel=1e-6)
    assert pixels.shape == (480, 640, 3)


@pytest.mark.first_case
@pytest.mark.parametrize(("yaw", "expected"), [(359.998, 0.0), (359.99, 359.99), (0.0, 0.0)])
def test_a_direction_is_below_a_whole_turn(tmp_path: Path, yaw: float, expected: float) -> None:
    content = taken(tmp_path, pose(5.0, 30.0, 20.0, -60.0, yaw))
    with Image.open(io.BytesIO(content)) as picture:
        assert float(picture.getexif().get_ifd(0x8825)[0x11]) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg"), [(-37.764, -58.296), (-16.855, 179.9999), (0.0001, 37.072)]
)
def test_positions_have_their_hemisphere(
    tmp_path: Path, latitude_deg: float, longitude_deg: float
) -> None:
    wanted = order(tmp_path, 0, DOWN, width_px=64)
    place = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg, "altitude_amsl_m": -2.5}
    fields = {name: getattr(wanted.estimate, name) for name in wanted.estimate.__dataclass_fields__}
    changed = {name: getattr(wanted, name) for name in wanted.__dataclass_fields__}
    write_picture(type(wanted)(**{**changed, "estimate": EstimatedPose(**{**fields, **place})}))
    survey, _ = read(Path(wanted.path).read_bytes())
    assert survey.latitude_deg == pytest.approx(latitude_deg, abs=1e-9)
    assert survey.longitude_deg == pytest.approx(longitude_deg, abs=1e-9)
    assert survey.altitude_m == pytest.approx(-2.5)


def test_the_later_description_is_the_one_for_mapping(tmp_path: Path) -> None:
    """OpenDroneMap lets it win: there pitch 0 is straight down."""
    with Image.open(io.BytesIO(taken(tmp_path, DOWN, width_px=64))) as picture:
        xmp = picture.info["xmp"].decode()
    assert xmp.index('GimbalPitchDegree="-90.0000"') < xmp.index('Camera:Pitch="0.0000"')
    assert 'Camera:BandName="RGB"' in xmp


def test_the_same_order_is_the_same_file(tmp_path: Path) -> None:
    assert taken(tmp_path / "a", DOWN) == taken(tmp_path / "b", DOWN)


@pytest.mark.first_case
@pytest.mark.parametrize("second", ["", "nir", "ndvi"])
def test_every_file_is_written_and_counted(tmp_path: Path, second: str) -> None:
    stored = write_picture(order(tmp_path / "image", 3, DOWN, width_px=800, second=second))
    found = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert stored.files == len(found) == (3 if second else 2)
    assert stored.size_bytes == sum(path.stat().st_size for path in found)
    with Image.open(tmp_path / "image" / "thumbnail" / "3.jpg") as small:
        assert small.size == (640, 480)
    if second:
        with Image.open(tmp_path / "image" / second / "3.jpg") as other:
            assert (other.mode, other.size) == ("L", (800, 600))
            assert np.asarray(other).std() > 0.0


def test_a_failure_leaves_no_file(tmp_path: Path) -> None:
    wanted = order(tmp_path / "image", 1, DOWN, width_px=64)
    (tmp_path / "image").mkdir()
    (tmp_path / "image" / "thumbnail").write_text("in the way")
    with pytest.raises(OSError, match=r"exists|directory"):
        write_picture(wanted)
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["thumbnail"]


def test_an_order_is_unchanged_after_serialisation(tmp_path: Path) -> None:
    wanted = order(tmp_path, 7, pose(1.0, 2.0, 3.0, -45.0, 10.0), second="ndvi")
    assert from_line(to_line(wanted)) == wanted


@given(st.text(max_size=60))
def test_what_is_no_order_is_refused(line: str) -> None:
    with pytest.raises(OrderError):
        from_line(line)
