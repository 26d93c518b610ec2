"""Child processes that exit with their parent, however it ends."""

import ctypes
import os
import signal
import sys
from typing import Final

_PR_SET_PDEATHSIG: Final = 1


def exit_with_parent(parent: int) -> None:
    """Have the kernel kill this process when its parent exits (Linux; prctl(2)).

    No data is lost: whatever was acknowledged is on the disk.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
