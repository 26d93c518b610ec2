"""The distribution that the programs are installed from; its version is written here alone."""

from typing import Final

VERSION: Final = "0.2.0"
