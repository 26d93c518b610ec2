"""A file system of a few megabytes, where the system lets us make one.

It is in memory; `SMALL_DISK=ext4` makes a real one in a file, whose metadata and journal take room,
and which allocates late.
"""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class NoSmallDiskError(Exception):
    """This user may not mount a file system."""


@contextmanager
def small_disk(folder: Path, megabytes: int) -> Iterator[Path]:
    """Give a folder on a disk of its own; raises NoSmallDiskError."""
    folder.mkdir()
    image = folder.with_name(f"{folder.name}.ext4")
    commands = [["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(folder)]]
    if os.environ.get("SMALL_DISK") == "ext4":
        commands = [
            ["truncate", f"--size={megabytes}M", str(image)],
            ["mkfs.ext4", "-q", "-m", "0", str(image)],
            ["mount", "-o", "loop", str(image), str(folder)],
        ]
    try:
        for command in commands:
            subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise NoSmallDiskError(str(error)) from None
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True, capture_output=True)
        image.unlink(missing_ok=True)


def fill_up(path: Path) -> None:
    """Take all room that is left, as another program would."""
    with path.open("ab", buffering=0) as file:
        for size in (65_536, 4096):
            try:
                while file.write(b"\xff" * size) == size:
                    continue
            except OSError:
                continue
