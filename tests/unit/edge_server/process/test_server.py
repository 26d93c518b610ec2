"""The web server refuses a setup in which it could not serve."""

import subprocess
import sys
from pathlib import Path

import pytest

from edge_server.process.exit_codes import WRONG_SETUP
from tests.support.polling import PATIENCE_S
from tests.unit.edge_server.program import program_in


@pytest.mark.parametrize("words", [("serve",), ()])
def test_a_limit_of_open_files_that_leaves_too_few_for_connections_is_a_wrong_setup(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    with program_in(tmp_path / "state") as program:
        command = ["bash", "-c", 'ulimit -n 300 && exec "$@"', "-", sys.executable, "-m"]
        with subprocess.Popen(
            [*command, "edge_server", *words],
            env=program.environment,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            try:
                _, complaint = process.communicate(timeout=PATIENCE_S)
            finally:
                process.terminate()
    assert process.returncode == WRONG_SETUP
    assert "the limit of open files (ulimit -n) is too low: it has to be at least 320" in complaint
