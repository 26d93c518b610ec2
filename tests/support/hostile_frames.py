"""Datagrams of an enemy, or of a broken client: seeded, endless, of every kind.

    frames = HostileFrames(seed=1, target=1)
    kind, datagram = next(frames)

None of them is a valid command to the vehicle, if `is_harmless`: what could command is damaged, or
meant for another vehicle. Otherwise right commands (disarm in flight, terminate, clear the
mission) are among them, for links on which nobody without a key must be listened to. Framed
here and not by the code under test.
"""

import hashlib
import math
import random
import struct
from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import development as mavlink

GROUND_SYSTEM, GROUND_COMPONENT = 255, 190
_SPECIAL_REAL: Final = (math.nan, math.inf, -math.inf, -0.0, 0.0, 1e-45, 3.4e38, -3.4e38, 1.0)
_INTEGERS: Final = {"b": 8, "B": 8, "h": 16, "H": 16, "i": 32, "I": 32, "q": 64, "Q": 64}
_COMMANDS: Final = (
    (400, 0.0, 21196.0),  # disarm in flight
    (400, 1.0),
    (185, 1.0),  # terminate
    (176, 1.0, 4.0, 6.0),  # mode: land
    (20,),  # return
    (21,),  # land
    (22, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan, 900.0),
    (192, -1.0, 1.0, 0.0, math.nan, 0.0, 0.0, 900.0),
    (193, 0.0),  # pause
    (178, 1.0, 12.0),  # speed
    (224, 0.0),  # first mission item
    (420, 0.0, 1.0, 0.0),  # break a gyroscope
)
_ACTING: Final = frozenset(
    {
        "COMMAND_LONG", "COMMAND_INT", "COMMAND_CANCEL", "SET_MODE", "MANUAL_CONTROL",
        "MISSION_ACK", "MISSION_CLEAR_ALL", "MISSION_COUNT", "MISSION_SET_CURRENT", "MISSION_ITEM",
        "MISSION_ITEM_INT", "MISSION_WRITE_PARTIAL_LIST", "PARAM_SET", "PARAM_EXT_SET",
        "SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED",
        "SET_POSITION_TARGET_GLOBAL_INT", "FOLLOW_TARGET", "SETUP_SIGNING", "LOG_ERASE",
        "FILE_TRANSFER_PROTOCOL", "SET_GPS_GLOBAL_ORIGIN", "SET_HOME_POSITION",
        "RC_CHANNELS_OVERRIDE", "GIMBAL_MANAGER_SET_ATTITUDE",
        "GIMBAL_MANAGER_SET_PITCHYAW", "GIMBAL_MANAGER_SET_MANUAL_CONTROL",
    }
)  # fmt: skip
"""Messages with which a listened-to ground station may rightly change something."""


class Datagram(NamedTuple):
    """What to send, and what is the matter with it."""

    kind: str
    contents: bytes


def framed(  # the header's fields, as MAVLink has them
    identifier: int,
    extra: int,
    payload: bytes,
    *,
    system: int = GROUND_SYSTEM,
    component: int = GROUND_COMPONENT,
    sequence: int = 0,
    flags: int = 0,
) -> bytes:
    """A version 2 frame of any payload of up to 255 bytes, its checksum right."""
    header = struct.pack(
        "<BBBBBBHB",
        len(payload),
        flags,
        0,
        sequence & 0xFF,
        system,
        component,
        identifier & 0xFFFF,
        identifier >> 16,
    )
    checksum = mavlink.x25crc(header + payload + bytes((extra,))).crc
    return b"\xfd" + header + payload + struct.pack("<H", checksum)


class HostileFrames(Iterator[Datagram]):
    """An endless stream; the same seed gives the same."""

    def __init__(self, seed: int, target: int, *, is_harmless: bool) -> None:
        self._random = random.Random(seed)
        self._target = target
        self._is_harmless = is_harmless
        self._classes: list[Any] = sorted(mavlink.mavlink_map.values(), key=lambda one: one.id)
        self._kinds: tuple[Callable[[], bytes], ...] = (
            self.noise,
            self.flipped,
            self.truncated,
            self.padded,
            self.special_values,
            self.special_values,
            self.random_contents,
            self.command_to_another,
            self.own_reflection,
            self.version_1,
            self.several_frames,
            self.split_frame,
            self.wrongly_signed,
            self.query,
            self.command,
        )

    def __next__(self) -> Datagram:
        """Give one more."""
        make = self._random.choice(self._kinds)
        return Datagram(make.__name__, make())

    # Kinds, each by its name in the figures

    def noise(self) -> bytes:
        """Random bytes, often with the first byte of a frame."""
        contents = self._random.randbytes(self._random.randrange(300))
        return self._random.choice((b"", b"\xfd", b"\xfe", b"\xfd\xff\x01")) + contents

    def flipped(self) -> bytes:
        """A right command in which bits have turned: up to three, which the checksum sees."""
        frame = bytearray(self._command(self._target))
        bits = self._random.sample(range(8 * len(frame)), self._random.choice((1, 1, 2, 3)))
        for bit in bits:
            frame[bit // 8] ^= 1 << bit % 8
        return bytes(frame)

    def truncated(self) -> bytes:
        """A right command that ends too soon, or whose payload does and whose checksum is right.

        MAVLink reads what is missing at the end as zeros, so a payload cut short is a message.
        """
        frame = self._command(self._target)
        if self._random.random() < 0.5:
            return frame[: self._random.randrange(len(frame))]
        chosen = self._any_class()
        payload = self._special(chosen)
        return self._frame(chosen, payload[: self._random.randrange(len(payload) + 1)])

    def padded(self) -> bytes:
        """A message with more bytes than it has fields for."""
        chosen = self._any_class()
        payload = self._special(chosen)
        room = 255 - len(payload)
        return self._frame(chosen, payload + self._random.randbytes(self._random.randint(0, room)))

    def special_values(self) -> bytes:
        """NaN, infinity, the smallest and the largest number in the fields of any message."""
        chosen = self._any_class()
        return self._frame(chosen, self._special(chosen))

    def random_contents(self) -> bytes:
        """Random bytes in the fields of any message."""
        chosen = self._any_class()
        return self._frame(chosen, self._random.randbytes(chosen.unpacker.size))

    def command_to_another(self) -> bytes:
        """A right command, for another vehicle or another component of this one."""
        if self._random.random() < 0.5:
            return self._command(self._target, component=self._random.randrange(2, 100))
        return self._command(self._target + self._random.randrange(1, 100))

    def own_reflection(self) -> bytes:
        """A frame that says to be the vehicle's own."""
        frame = bytearray(self._command(self._target, source=(self._target, 1)))
        return bytes(frame)

    def version_1(self) -> bytes:
        """A frame of the old version."""
        message = self._random.choice((self._heartbeat(), self._ping()))
        return bytes(message.pack(self._codec(), force_mavlink1=True))

    def several_frames(self) -> bytes:
        """Right, wrong and cut frames in one datagram."""
        return b"".join(
            self._random.choice((self.noise, self.special_values, self.query, self.flipped))()
            for _ in range(self._random.randint(2, 5))
        )

    def split_frame(self) -> bytes:
        """The end of a right command without its beginning, or the beginning without its end."""
        frame = self._command(self._target)
        cut = self._random.randrange(1, len(frame))
        return self._random.choice((frame[:cut], frame[cut:]))

    def wrongly_signed(self) -> bytes:
        """A right command, signed by a key that nobody has, with any time.

        A vehicle without any key must listen to it, so a harmless one is for another.
        """
        frame = self._command(self._target + self._is_harmless, flags=1)
        body = frame + self._random.randbytes(1 + 6)
        return body + hashlib.sha256(bytes(32) + body).digest()[:6]

    def query(self) -> bytes:
        """What every client may ask."""
        message = self._random.choice(
            (
                self._heartbeat(),
                self._ping(),
                mavlink.MAVLink_timesync_message(0, self._random.getrandbits(60)),
                mavlink.MAVLink_param_request_read_message(self._target, 1, b"MPC_XY_P", -1),
                mavlink.MAVLink_param_request_list_message(self._target, 1),
                mavlink.MAVLink_mission_request_list_message(self._target, 1, 0),
                mavlink.MAVLink_mission_request_int_message(
                    self._target, 1, self._random.randrange(9), 0
                ),
                mavlink.MAVLink_command_long_message(
                    self._target, 1, 512, 0, self._random.randrange(400), 0, 0, 0, 0, 0, 0
                ),
            )
        )
        return bytes(message.pack(self._codec()))

    def command(self) -> bytes:
        """A right command; from a stream of harmless frames, one that no vehicle knows."""
        if not self._is_harmless:
            return self._command(self._target)
        unknown = self._random.randrange(60_000, 65_536)
        parameters = [self._random.choice(_SPECIAL_REAL) for _ in range(7)]
        message = mavlink.MAVLink_command_long_message(self._target, 1, unknown, 0, *parameters)
        return bytes(message.pack(self._codec()))

    # How they are made

    def _any_class(self) -> Any:
        return self._random.choice(self._classes)

    def _frame(self, chosen: Any, payload: bytes) -> bytes:
        """A frame of a message; one that could act is for another vehicle, if that is promised."""
        if self._is_harmless and chosen.msgname in _ACTING:
            payload = self._misaddressed(chosen, payload)
        return framed(chosen.id, chosen.crc_extra, payload[:255])

    def _misaddressed(self, chosen: Any, payload: bytes) -> bytes:
        """A payload of which the addressee is not the vehicle; empty where there is none."""
        names = list(chosen.ordered_fieldnames)
        name = "target_system" if "target_system" in names else "target"
        whole = payload.ljust(chosen.unpacker.size, b"\0")
        if name not in names or chosen.msgname == "FOLLOW_TARGET":
            return b"\0"
        layout = bytes(chosen.native_format).decode().removeprefix("<")
        counts = [max(length, 1) for length in chosen.array_lengths]
        offset = 0
        for field, letter, count in zip(names, layout, counts, strict=False):
            if field == name:
                changed = bytearray(whole)
                changed[offset] = (self._target + 100) & 0xFF
                return bytes(changed)
            offset += struct.calcsize("<" + letter) * count
        return b"\0"

    def _special(self, chosen: Any) -> bytes:
        """The fields of a message, each at a border of what it can hold."""
        layout = bytes(chosen.native_format).decode().removeprefix("<")
        lengths = [max(length, 1) for length in chosen.array_lengths]
        fields = zip(layout, lengths, strict=False)
        return b"".join(self._border(letter) for letter, count in fields for _ in range(count))

    def _border(self, letter: str) -> bytes:
        if letter in "fd":
            return struct.pack("<" + letter, self._random.choice(_SPECIAL_REAL))
        if letter in _INTEGERS:
            bits = _INTEGERS[letter]
            low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if letter.islower() else (0, 0)
            high = high or (1 << bits) - 1
            addressee = self._target if letter == "B" else 0
            return struct.pack("<" + letter, self._random.choice((low, high, 0, 1, addressee)))
        return self._random.randbytes(1)

    def _command(
        self,
        target: int,
        *,
        component: int = 1,
        source: tuple[int, int] = (GROUND_SYSTEM, GROUND_COMPONENT),
        flags: int = 0,
    ) -> bytes:
        number, *given = self._random.choice(_COMMANDS)
        parameters = [*given, *[0.0] * (7 - len(given))]
        payload = struct.pack("<7fHBBB", *parameters, number, target & 0xFF, component, 0)
        system, of = source
        return framed(76, 152, payload, system=system, component=of, flags=flags)

    @staticmethod
    def _codec() -> Any:
        return mavlink.MAVLink(None, GROUND_SYSTEM, GROUND_COMPONENT)

    @staticmethod
    def _heartbeat() -> Any:
        return mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)

    def _ping(self) -> Any:
        return mavlink.MAVLink_ping_message(self._random.getrandbits(60), 1, 0, 0)
