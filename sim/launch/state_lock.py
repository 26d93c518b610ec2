"""One system per state folder: two would fly with the same keys, parameters and database."""

import fcntl
import os
from pathlib import Path
from typing import Final

from sim.launch.supervisor import SupervisorError

NAME: Final = "system.lock"


class StateTakenError(SupervisorError):
    """Another system runs on the state folder."""


class StateLock:
    """Held while a system runs; the kernel releases it with the process, however that ends."""

    def __init__(self, state_dir: Path) -> None:
        self._state_dir = state_dir
        self._descriptor: int | None = None

    def take(self) -> None:
        """Take the folder, before anything in it is touched.

        Raises:
            StateTakenError: naming the process that has it.
            SupervisorError: if the folder cannot be used.
        """
        try:
            self._state_dir.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC
            descriptor = os.open(self._state_dir / NAME, flags, 0o600)
        except OSError as error:
            raise SupervisorError(f"STATE_DIR {self._state_dir}: {error.strerror}") from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(descriptor, 32).decode("ascii", "replace").strip()
            os.close(descriptor)
            raise StateTakenError(
                f"STATE_DIR {self._state_dir}: a system runs on it already (process {holder}); "
                "stop that one, or set STATE_DIR and the ports for this one"
            ) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode("ascii"), 0)
        self._descriptor = descriptor

    def release(self) -> None:
        """Leave the folder to another system."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
