"""One system per state folder."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sim.launch.state_lock import StateLock, StateTakenError
from sim.launch.supervisor import SupervisorError
from tests.support.system import ROOT

HOLDER = (
    "import sys, time; from pathlib import Path; from sim.launch.state_lock import StateLock; "
    "lock = StateLock(Path(sys.argv[1])); lock.take(); print('taken', flush=True); time.sleep(600)"
)


def test_a_second_system_is_refused_with_the_first_one_s_process(tmp_path: Path) -> None:
    first, second = StateLock(tmp_path / "var"), StateLock(tmp_path / "var")
    first.take()
    with pytest.raises(StateTakenError, match=rf"STATE_DIR .*var: .*\(process {os.getpid()}\)"):
        second.take()
    first.release()
    second.take()
    second.release()


def test_a_system_that_was_killed_leaves_the_folder_free(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"taken\n"
        with pytest.raises(StateTakenError, match=rf"process {holder.pid}"):
            StateLock(tmp_path).take()
        holder.send_signal(signal.SIGKILL)
    lock = StateLock(tmp_path)
    lock.take()
    lock.release()


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(SupervisorError, match=r"STATE_DIR .*file"):
        StateLock(tmp_path / "file" / "var").take()
