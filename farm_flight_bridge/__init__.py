"""The distribution that the programs are installed from; its version is written here alone."""

import sys
from pathlib import Path
from typing import Final

VERSION: Final = "0.2.0"


def program_name(module: str) -> str:
    """Name of the running program in its help: the installed one, else that of its module."""
    started = Path(sys.argv[0]).name
    return started if started.startswith("farm-") else module
