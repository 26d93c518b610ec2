"""The process beside the vehicle: orders in, ends out, in order; it dies and comes back."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim.camera.film.orders import to_line
from sim.camera.film.render_process import Rendered, RenderProcess
from tests.support.system import ROOT, wait_for
from tests.unit.sim.camera.shots import order, pose

DOWN = pose(5.0, 30.0, 20.0, -90.0, 0.0)


@pytest.fixture
def render_process() -> Iterator[RenderProcess]:
    made = RenderProcess()
    yield made
    made.close()


def all_of(render_process: RenderProcess, count: int) -> list[Rendered]:
    ended: list[Rendered] = []
    while len(ended) < count:
        ended += render_process.finished(wait=True)
    return ended


@pytest.mark.thorough
def test_orders_end_in_their_sequence_while_nobody_waits(
    render_process: RenderProcess, tmp_path: Path
) -> None:
    for number in range(3):
        render_process.begin(order(tmp_path, number, DOWN, width_px=320))
    assert render_process.pending == 3
    ended: list[Rendered] = []
    wait_for(lambda: len(ended.extend(render_process.finished()) or ended) == 3, "three pictures")  # type: ignore[func-returns-value]  # for its effect
    assert [each.number for each in ended] == [0, 1, 2]
    assert [each.error for each in ended] == ["", "", ""]
    assert all((tmp_path / f"{number}.jpg").stat().st_size for number in range(3))
    assert render_process.pending == 0


def test_what_cannot_be_written_is_said_and_the_next_goes_on(
    render_process: RenderProcess, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("no folder")
    render_process.begin(order(tmp_path / "file", 0, DOWN, width_px=64))
    render_process.begin(order(tmp_path / "folder", 1, DOWN, width_px=64))
    bad, good = all_of(render_process, 2)
    assert (bad.number, good.number) == (0, 1)
    assert bad.error
    assert not good.error


@pytest.mark.thorough
def test_a_process_that_dies_loses_its_pictures_and_is_started_again(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    script = (
        "import os, sys, pathlib; pathlib.Path(sys.argv[1]).open('a').write(f'{os.getpid()}\\n'); "
        "sys.argv = ['x']; from sim.camera.__main__ import main; main()"
    )
    render_process = RenderProcess((sys.executable, "-c", script, str(pids)))
    try:
        render_process.begin(order(tmp_path, 0, DOWN, width_px=64))
        all_of(render_process, 1)
        os.kill(int(pids.read_text()), signal.SIGSTOP)
        render_process.begin(order(tmp_path, 1, DOWN, width_px=64))
        os.kill(int(pids.read_text()), signal.SIGKILL)
        (lost,) = all_of(render_process, 1)
        assert lost.number == 1
        assert "stopped" in lost.error
        render_process.begin(order(tmp_path, 2, DOWN, width_px=64))
        (found,) = all_of(render_process, 1)
        assert found == Rendered(2, found.size_bytes, 2, "")
        assert len(pids.read_text().split()) == 2
    finally:
        render_process.close()


@pytest.mark.thorough
def test_the_process_ends_in_peace_when_its_vehicle_is_killed(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "sim.camera"],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    lines = [to_line(order(tmp_path, number, DOWN, width_px=64)) for number in range(2)]
    process.stdin.write("".join(f"{line}\n" for line in lines).encode())
    process.stdin.close()
    with process.stderr:
        assert process.stderr.read() == b""
    assert process.wait(60) == 0
    assert not (tmp_path / "1.jpg").exists()


def test_it_ends_with_its_vehicle(render_process: RenderProcess, tmp_path: Path) -> None:
    render_process.begin(order(tmp_path, 0, DOWN, width_px=64))
    render_process.close()
    assert render_process.pending == 0
    assert render_process.finished() == []
