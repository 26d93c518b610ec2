"""One picture as its camera announces it, and the location of its file."""

import re
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias
from urllib.parse import urlsplit

from mavlink_broker.mavlink.dialect import Message, source_of

_FTP_URL: Final = re.compile(r"^(?:mftp|mavftp|mavlinkftp|file)://(.*)$", re.DOTALL)
_COMPONENT: Final = re.compile(r"^/?\[?;comp=(\d{1,3})\]?(.*)$", re.DOTALL)


class FileLocation(NamedTuple):
    """A file on the vehicle, read over MAVFTP; without a component it is on the camera."""

    path: str
    component: int | None = None


class WebLocation(NamedTuple):
    """A file on a web server, such as the camera's."""

    url: str


Location: TypeAlias = FileLocation | WebLocation


def location_of(url: str) -> Location | None:
    """Parse `file_url`: `mftp://[;comp=<id>]path`, a plain path, http or https; None for others."""
    match = _FTP_URL.match(url)
    if match is not None:
        with_component = _COMPONENT.match(match[1])
        path = match[1] if with_component is None else with_component[2]
        component = None if with_component is None else int(with_component[1])
        is_component = component is None or 1 <= component <= 255
        return FileLocation(path, component) if path and is_component else None
    if "://" not in url:
        return FileLocation(url) if url else None
    try:
        parts = urlsplit(url)
    except ValueError:
        return None
    return WebLocation(url) if parts.scheme in {"http", "https"} and parts.hostname else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Capture:
    """CAMERA_IMAGE_CAPTURED(263)."""

    component: int
    index: int
    taken_s: float | None  # By its camera's clock since boot; None: not sent
    taken_utc_s: float | None = None  # Since 1970; None: its clock is not set
    altitude_m: float  # Above home
    has_succeeded: bool
    url: str
    identity: str  # The same for the same picture, however often it is announced

    @property
    def location(self) -> Location | None:
        """The location of its file."""
        return location_of(self.url)


def read_capture(message: Message) -> Capture:
    """Parse CAMERA_IMAGE_CAPTURED(263)."""
    component, url = source_of(message).component, str(message.file_url)
    fields = (message.time_utc, message.time_boot_ms, message.lat, message.lon, message.image_index)
    return Capture(
        component=component,
        index=message.image_index,
        taken_s=message.time_boot_ms / 1e3 if message.time_boot_ms else None,
        taken_utc_s=message.time_utc / 1e6 if message.time_utc > 0 else None,
        altitude_m=message.relative_alt / 1e3,
        has_succeeded=message.capture_result == 1,
        url=url,
        identity="/".join(map(str, (component, message.camera_id, *fields, url))),
    )
