"""Keys of the MAVLink links between broker and vehicles: one per vehicle, made once.

One key for all would let a captured vehicle speak for every other.
"""

import os
import secrets

from sim.launch.settings import Settings

KEY_LENGTH = 32


def prepare(settings: Settings) -> None:
    """Make the keys that are missing, readable by their owner only, before a program starts.

    Raises:
        OSError: if the folder or a file cannot be written.
    """
    for system_id in range(1, settings.vehicles + 1):
        path = settings.signing_key_path(system_id)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        draft = path.with_suffix(".new")
        draft.unlink(missing_ok=True)
        if path.exists():
            continue
        descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(secrets.token_bytes(KEY_LENGTH).hex() + "\n")
        draft.replace(path)
