"""Runs a program of this package on a picture: with a deadline, without a shell."""

import subprocess
import sys
from pathlib import Path
from typing import Final

_REASON_CHARACTERS: Final = 200


class UnreadableError(Exception):
    """A picture that cannot be made smaller; the text says why."""


class BusyError(Exception):
    """Too many pictures wait; a later request may succeed."""


def run(name: str, *arguments: str, data: bytes = b"", within_s: float) -> bytes:
    """Run a program and give what it writes.

    The module is not imported: it loads the library that reads pictures.

    Raises:
        UnreadableError: if it fails or does not end in time.
        BusyError: if it cannot be started.
    """
    program = Path(__file__).with_name(f"{name}.py")
    try:
        done = subprocess.run(  # noqa: S603  # our own program, and no shell
            [sys.executable, "-I", str(program), *arguments],
            input=data,
            capture_output=True,
            timeout=within_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise UnreadableError("reading it takes too long") from None
    except OSError as error:
        raise BusyError(f"pictures cannot be read now: {error}") from error
    if done.returncode != 0 or not done.stdout:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        reason = lines[-1][:_REASON_CHARACTERS] if lines else f"status {done.returncode}"
        raise UnreadableError(reason)
    return done.stdout
