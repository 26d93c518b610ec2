"""EXIF and XMP of a picture: what mapping software reads. Pure.

EXIF 2.32 (CIPA DC-008) for place, time and lens. XMP in two descriptions: first the names that
DJI's aircraft write (pitch -90 is straight down), then those of Pix4D and OpenDroneMap, `Camera:`
(pitch 0 is straight down, 90 ahead). OpenDroneMap lets the later description win, and takes DJI's
pitch for its own unless the maker is DJI; the order is therefore part of the format.
"""

import math
from datetime import UTC, datetime
from typing import Final, NamedTuple
from xml.sax.saxutils import quoteattr

from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from sim.camera.film.orders import EstimatedPose
from sim.camera.scene.lens import Lens, rotation
from sim.physics.truth import Quaternion

MAKE: Final = "Farm Flight Bridge"
MODEL: Final = "Simulated F450 camera"
_STEEP: Final = 0.02  # Cosine of pitch below which yaw cannot be read from the optical axis
_EXIF_IFD, _GPS_IFD = 0x8769, 0x8825
_CENTIMETRE: Final = 3  # FocalPlaneResolutionUnit


class Angles(NamedTuple):
    """Aerospace Euler angles [deg]: yaw 0 to 360 from north, pitch up positive, roll."""

    yaw: float
    pitch: float
    roll: float


def angles(q: Quaternion) -> Angles:
    """Euler angles of a rotation to NED; straight down or up, roll is taken as zero."""
    matrix = rotation(q)
    forward, right, down = matrix[:, 0], matrix[:, 1], matrix[:, 2]
    level = math.hypot(forward[0], forward[1])
    pitch = math.degrees(math.atan2(-forward[2], level))
    if level < _STEEP:
        return Angles(math.degrees(math.atan2(-right[0], right[1])) % 360.0, pitch, 0.0)
    yaw = math.degrees(math.atan2(forward[1], forward[0])) % 360.0
    return Angles(yaw, pitch, math.degrees(math.atan2(right[2], down[2])))


def exif(estimate: EstimatedPose, lens: Lens, number: int, description: str = "") -> bytes:
    """The EXIF block."""
    tags = Image.Exif()
    tags[0x010F], tags[0x0110] = MAKE, MODEL
    tags[0x0112] = 1  # Orientation: as it lies
    if description:
        tags[0x010E] = description
    details = tags.get_ifd(_EXIF_IFD)
    _add_time(tags, details, estimate.time_utc_us)
    details[0x9000], details[0xA001] = b"0232", 1  # ExifVersion; ColorSpace: sRGB
    details[0x829A] = IFDRational(1, 800)  # ExposureTime
    details[0x829D] = IFDRational(28, 10)  # FNumber
    details[0x8827] = 100  # ISO speed
    details[0x920A] = _rational(lens.focal_length_mm, 1000)
    details[0xA002], details[0xA003] = lens.width_px, lens.height_px
    details[0xA20E] = _rational(10.0 * lens.width_px / lens.sensor_width_mm, 10_000)
    details[0xA20F] = _rational(10.0 * lens.height_px / lens.sensor_height_mm, 10_000)
    details[0xA210] = _CENTIMETRE
    details[0xA420] = f"{estimate.time_utc_us & (2**64 - 1):016x}{number & (2**64 - 1):016x}"
    details[0xA431] = estimate.serial
    _add_place(tags.get_ifd(_GPS_IFD), estimate)
    return tags.tobytes()


def _add_time(tags: Image.Exif, details: dict[int, object], time_utc_us: int) -> None:
    if time_utc_us <= 0:
        return
    moment = datetime.fromtimestamp(time_utc_us // 1_000_000, UTC)
    text = f"{moment:%Y:%m:%d %H:%M:%S}"
    tags[0x0132] = details[0x9003] = details[0x9004] = text
    details[0x9010] = details[0x9011] = details[0x9012] = "+00:00"
    details[0x9290] = details[0x9291] = details[0x9292] = f"{time_utc_us // 1000 % 1000:03}"


def _add_place(gps: dict[int, object], estimate: EstimatedPose) -> None:
    """Position, direction of view and time; a vehicle without a position writes none."""
    gps[0x0000] = b"\x02\x03\x00\x00"
    if estimate.latitude_deg is not None and estimate.longitude_deg is not None:
        gps[0x0001] = "N" if estimate.latitude_deg >= 0.0 else "S"
        gps[0x0002] = _degrees(estimate.latitude_deg)
        gps[0x0003] = "E" if estimate.longitude_deg >= 0.0 else "W"
        gps[0x0004] = _degrees(estimate.longitude_deg)
        gps[0x0012] = "WGS-84"
    if estimate.altitude_amsl_m is not None:
        gps[0x0005] = b"\x00" if estimate.altitude_amsl_m >= 0.0 else b"\x01"
        gps[0x0006] = _rational(abs(estimate.altitude_amsl_m), 1000)
    if estimate.time_utc_us > 0:
        moment = datetime.fromtimestamp(estimate.time_utc_us // 1_000_000, UTC)
        seconds = IFDRational(moment.second * 1000 + estimate.time_utc_us // 1000 % 1000, 1000)
        gps[0x0007] = (IFDRational(moment.hour), IFDRational(moment.minute), seconds)
        gps[0x001D] = f"{moment:%Y:%m:%d}"
    hundredths = round(angles(estimate.q_ned_camera).yaw * 100.0) % 36_000  # EXIF has no 360
    gps[0x0010], gps[0x0011] = "T", IFDRational(hundredths, 100)


def _degrees(value: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    """Degrees, minutes and seconds, to a microsecond of arc: 0.03 mm."""
    millionths = round(abs(value) * 3600.0 * 1e6)
    minutes, rest = divmod(millionths, 60_000_000)
    return IFDRational(minutes // 60), IFDRational(minutes % 60), IFDRational(rest, 1_000_000)


def _rational(value: float, denominator: int) -> IFDRational:
    return IFDRational(round(value * denominator), denominator)


def xmp(estimate: EstimatedPose, lens: Lens, band: str) -> bytes:
    """The XMP packet; `band` is what OpenDroneMap names a picture's band."""
    camera, body = angles(estimate.q_ned_camera), angles(estimate.q_ned_frd)
    aircraft = {
        "GimbalYawDegree": _signed(_half_turn(camera.yaw)),
        "GimbalPitchDegree": _signed(camera.pitch),
        "GimbalRollDegree": _signed(camera.roll),
        "FlightYawDegree": _signed(_half_turn(body.yaw)),
        "FlightPitchDegree": _signed(body.pitch),
        "FlightRollDegree": _signed(body.roll),
        "DroneModel": MODEL,
        "DroneSerialNumber": estimate.serial,
        "CameraSerialNumber": estimate.serial,
    }
    if estimate.latitude_deg is not None and estimate.longitude_deg is not None:
        aircraft["GpsLatitude"] = f"{estimate.latitude_deg:.9f}"
        aircraft["GpsLongitude"] = f"{estimate.longitude_deg:.9f}"
    if estimate.altitude_amsl_m is not None:
        aircraft["AbsoluteAltitude"] = _signed(estimate.altitude_amsl_m)
    if estimate.relative_altitude_m is not None:
        aircraft["RelativeAltitude"] = _signed(estimate.relative_altitude_m)
    mapping = {
        "Yaw": f"{camera.yaw:.4f}",
        "Pitch": f"{90.0 + camera.pitch:.4f}",
        "Roll": f"{camera.roll:.4f}",
        "ModelType": "perspective",
        "PerspectiveFocalLength": f"{lens.focal_length_mm:g}",
        "PerspectiveDistortion": "0,0,0,0,0",
        "PrincipalPoint": f"{0.5 * lens.sensor_width_mm:g},{0.5 * lens.sensor_height_mm:g}",
        "BandName": band,
    }
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>'
        '<x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        + _description("drone-dji", "http://www.dji.com/drone-dji/1.0/", aircraft)
        + _description("Camera", "http://pix4d.com/camera/1.0/", mapping)
        + '</rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _description(prefix: str, namespace: str, values: dict[str, str]) -> str:
    attributes = " ".join(f"{prefix}:{name}={quoteattr(text)}" for name, text in values.items())
    return f'<rdf:Description rdf:about="" xmlns:{prefix}="{namespace}" {attributes}/>'


def _signed(value: float) -> str:
    """With its sign, as DJI writes angles and altitudes."""
    return f"{value + 0.0:+.4f}"


def _half_turn(yaw_deg: float) -> float:
    """-180 to 180, as DJI writes yaw."""
    return (yaw_deg + 180.0) % 360.0 - 180.0
