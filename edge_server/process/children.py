"""Settings of processes: child processes exit with their parent, threads share memory's arenas."""

import ctypes
import os
import signal
import sys
from typing import Final

_PR_SET_PDEATHSIG: Final = 1
_M_ARENA_MAX: Final = -8
_ARENAS: Final = 2


def exit_with_parent(parent: int) -> None:
    """Have the kernel kill this process when its parent exits (Linux; prctl(2)).

    No data is lost: whatever was acknowledged is on the disk.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


def share_arenas() -> None:
    """Let the threads of this process and of its children share arenas (glibc; mallopt(3)).

    Otherwise malloc makes up to eight for each processor, and each keeps memory that it had.
    """
    if sys.platform == "linux" and (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)):
        mallopt(_M_ARENA_MAX, _ARENAS)
