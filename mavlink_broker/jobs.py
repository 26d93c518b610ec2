"""What is done beside the program's loop, because it takes long: asked for, and how it went."""

from dataclasses import dataclass
from typing import TypeAlias

from afarcloud.enumerations import ImageFormat


@dataclass(frozen=True, slots=True)
class FetchUrl:
    """Get a file of at most so many bytes from a web server."""

    number: int
    url: str
    limit_bytes: int


@dataclass(frozen=True, slots=True)
class Develop:
    """Make what AFarCloud takes of the bytes of a picture."""

    number: int
    data: bytes


Job: TypeAlias = FetchUrl | Develop


@dataclass(frozen=True, slots=True)
class Downloaded:
    """A file has come."""

    number: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Developed:
    """A picture is ready; `frame` is its base64."""

    number: int
    format: ImageFormat
    frame: str
    size_bytes: int


@dataclass(frozen=True, slots=True)
class JobFailed:
    """It could not be done."""

    number: int
    reason: str


JobOutcome: TypeAlias = Downloaded | Developed | JobFailed
