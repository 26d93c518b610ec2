"""Settings of processes: children exit with their parent, and freed memory is given back."""

import ctypes
import os
import signal
import sys
from typing import Final

_PR_SET_PDEATHSIG: Final = 1
_M_ARENA_MAX: Final = -8
_M_MMAP_THRESHOLD: Final = -3
_M_TRIM_THRESHOLD: Final = -1
_ARENAS: Final = 2
_LARGE_BLOCK_BYTES: Final = 128 * 1024
"""The system's own values at the start of a process; fixed, they do not grow."""


def exit_with_parent(parent: int) -> None:
    """Have the kernel kill this process when its parent exits (Linux; prctl(2)).

    No data is lost: whatever was acknowledged is on the disk.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


def bound_free_memory() -> None:
    """Have this process and its children give freed memory back (glibc; mallopt(3)).

    Otherwise malloc makes up to eight arenas for each processor, of which each keeps memory that it
    had, and takes ever larger blocks, such as pictures, from them.
    """
    if sys.platform == "linux" and (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)):
        mallopt(_M_ARENA_MAX, _ARENAS)
        mallopt(_M_MMAP_THRESHOLD, _LARGE_BLOCK_BYTES)
        mallopt(_M_TRIM_THRESHOLD, _LARGE_BLOCK_BYTES)
