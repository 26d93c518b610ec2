"""Broker, vehicle and stock pymavlink understand each other's signatures."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.signing import KeyRing, LinkSigning, SignatureCheck
from uav_firmware.modules.mavlink.wire import dialect
from uav_firmware.modules.mavlink.wire.signature import Signer, SigningClock

KEY, WRONG_KEY = bytes(range(32)), bytes(range(1, 33))
NOW = datetime(2026, 9, 1, tzinfo=UTC)
TICKS = int((NOW - datetime(2015, 1, 1, tzinfo=UTC)).total_seconds() * 100_000)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)


def from_the_vehicle(key: bytes) -> bytes:
    signer = Signer(key, SigningClock(lambda: int(NOW.timestamp() * 1e6)))
    message = dialect.mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
    return signer.sign(dialect.frame(dialect.pack(message), 0, 1, 1, signed=True), 0)


def from_the_broker(key: bytes) -> bytes:
    return Encoder(1, 1).encode(HEARTBEAT, LinkSigning(key, lambda: NOW).next_signature())


def from_pymavlink(key: bytes) -> bytes:
    codec = common.MAVLink(None, 1, 1)
    codec.signing.secret_key = key
    codec.signing.timestamp = TICKS
    codec.signing.sign_outgoing = True
    return bytes(common.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(codec))


def vehicle_takes(frame: bytes, _folder: Path) -> bool:
    (message,) = dialect.parse(frame).messages
    signer = Signer(KEY, SigningClock(lambda: int(NOW.timestamp() * 1e6)))
    return signer.verify(bytes(message.get_msgbuf()), 1, 1) is None


def broker_takes(frame: bytes, folder: Path) -> bool:
    path = folder / "signing-1.key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    (message,) = Decoder().decode(frame)
    return SignatureCheck(KeyRing(folder), (), lambda: NOW).accepts(message, 0.0)


def pymavlink_takes(frame: bytes, _folder: Path) -> bool:
    codec = common.MAVLink(None)
    codec.signing.secret_key = KEY
    codec.signing.timestamp = TICKS
    try:
        return bool(codec.decode(bytearray(frame)).get_signed())
    except common.MAVError:
        return False


@pytest.mark.parametrize("sender", [from_the_vehicle, from_the_broker, from_pymavlink])
@pytest.mark.parametrize("receiver", [vehicle_takes, broker_takes, pymavlink_takes])
def test_a_signature_is_understood_by_all_who_hold_the_key_and_by_no_other(
    tmp_path: Path, sender: Callable[[bytes], bytes], receiver: Callable[[bytes, Path], bool]
) -> None:
    assert receiver(sender(KEY), tmp_path)
    assert not receiver(sender(WRONG_KEY), tmp_path)
