"""Ctrl-C at the earliest moment: no program ends with a traceback."""

import signal
import subprocess
import sys
import tomllib

import pytest

from tests.support.system import ROOT

ENDED = -signal.SIGINT
IGNORED = 0
"""The vehicle decides when its camera ends: by closing the standard input."""

SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("program", "status"),
    [
        ("edge_server", ENDED),
        ("mavlink_broker", ENDED),
        ("uav_firmware", ENDED),
        ("sim", ENDED),
        ("sim.cloud", ENDED),
        ("sim.tester", ENDED),
        ("dst", ENDED),
        ("sim.camera", IGNORED),
    ],
)
def test_an_interrupt_while_a_program_is_loaded(program: str, status: int) -> None:
    assert interrupted(["-m", program], program) == status


@pytest.mark.first_case
@pytest.mark.parametrize("name", sorted(SCRIPTS))
def test_an_interrupt_while_an_installed_program_is_loaded(name: str) -> None:
    module, function = SCRIPTS[name].split(":")
    started = f"import sys; from {module} import {function}; sys.exit({function}())"
    program = function if function != "main" else module.partition(".")[0]
    assert interrupted(["-c", started], program) == ENDED


def interrupted(arguments: list[str], program: str) -> int:
    """Interrupt a program that begins to load; gives its status.

    The interpreter reports each module that is loaded; the first of ours starts the race.
    """
    command = [sys.executable, "-X", "importtime", *arguments]
    with subprocess.Popen(
        command,
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        package = program.partition(".")[0]
        for line in process.stderr:
            module = line.rpartition("|")[2].strip()
            if module.startswith(f"{package}.") and module != program:
                break
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=120)
    assert "Traceback" not in rest
    return process.returncode
