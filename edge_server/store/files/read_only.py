"""A state folder whose file system is read-only: a kernel does that after an error of the disk.

It may become writable again, and nothing can be stored before. The programs wait.
"""

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

LOG = logging.getLogger(__name__)
LOOK_S: Final = 0.5
LOG_INTERVAL_S: Final = 60.0


def is_read_only(folder: Path) -> bool:
    """Whether the file system on which a folder is, or is to be made, is mounted read-only."""
    try:
        places = (folder, *folder.absolute().parents)
        present = next((one for one in places if one.exists()), folder)
        return bool(os.statvfs(present).f_flag & os.ST_RDONLY)
    except OSError:
        return False


def wait_until_writable(
    folder: Path,
    wait: Callable[[float], bool],
    is_read_only: Callable[[Path], bool] = is_read_only,
) -> None:
    """Wait while the folder is read-only, and say so once a minute.

    `wait` is `threading.Event.wait` of the event that ends the program: it ends the waiting too.
    """
    waited_s = 0.0
    while is_read_only(folder):
        if waited_s % LOG_INTERVAL_S == 0.0:
            LOG.error(
                "the file system of the state folder %s is read-only: nothing can be stored, and "
                "no request is served until it is writable; see what has happened to its disk "
                "(dmesg), then mount -o remount,rw",
                folder,
            )
        if wait(LOOK_S):
            return
        waited_s += LOOK_S
    if waited_s:
        LOG.warning("the state folder %s is writable again", folder)
