"""A key is loaded into vehicles that behave as PX4 and ArduPilot do, and into no other state."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.signing import LinkSigning
from mavlink_broker.microservices.signing_setup import Outcome, SigningSetup

NOW = datetime(2026, 9, 1, tzinfo=UTC)
KEY, NEXT_KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33)), bytes(range(2, 34))
SYSTEM = 7


class Vehicle:
    """Stores a key as PX4 1.18 does: the first one unsigned, others signed, none while armed."""

    def __init__(
        self,
        key: bytes | None = None,
        *,
        armed: bool = False,
        knows_signatures: bool = True,
        version_1: int = 0,  # Heartbeats in MAVLink 1 before it changes to 2
        frames_lost: int = 0,
    ) -> None:
        self.key = key
        self.setups = 0
        self._armed, self._knows_signatures = armed, knows_signatures
        self._version_1, self._frames_lost = version_1, frames_lost
        self._decoder, self._encoder = Decoder(), Encoder(SYSTEM, 1)

    def heartbeat(self, now: float) -> bytes:
        mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self._armed else 0
        message = mavlink.MAVLink_heartbeat_message(2, 12, mode, 0, 4, 3)
        if self._version_1:
            self._version_1 -= 1
            return bytes(message.pack(mavlink.MAVLink(None, SYSTEM, 1), force_mavlink1=True))
        if self.key is None:
            return self._encoder.encode(message)
        return self._encoder.encode(message, self._signing(now).next_signature())

    def receive(self, frame: bytes, now: float) -> None:
        for message in self._decoder.decode(frame):
            if message.get_type() != "SETUP_SIGNING":
                continue
            if self._frames_lost:
                self._frames_lost -= 1
                continue
            self.setups += 1
            self._take(message, now)

    def _take(self, message: Any, now: float) -> None:
        signed = bool(message.get_header().incompat_flags & 1)
        is_genuine = signed and self._signing(now).is_of_this_key(message.get_msgbuf())
        if self._knows_signatures and not self._armed and (self.key is None or is_genuine):
            key = bytes(message.secret_key)
            self.key = key if any(key) else None

    def _signing(self, now: float) -> LinkSigning:
        return LinkSigning(self.key or bytes(32), lambda: NOW + timedelta(seconds=now))


def load(
    vehicle: Vehicle | None, key: bytes | None, current: bytes | None = None
) -> tuple[Outcome, int]:
    """Let both talk for up to half a minute; gives the outcome and how often a key was sent."""
    setup = SigningSetup(SYSTEM, key, current_key=current, own_system=254, utc=lambda: NOW)
    decoder = Decoder()
    for tick in range(300):
        now = tick / 10.0
        if vehicle is not None and tick % 10 == 5:
            for message in decoder.decode(vehicle.heartbeat(now)):
                setup.receive(message, now)
        for frame in setup.step(now):
            if vehicle is not None:
                vehicle.receive(frame, now)
        if setup.outcome is not None:
            return setup.outcome, 0 if vehicle is None else vehicle.setups
    raise AssertionError("it does not end")


@pytest.mark.parametrize("frames_lost", [0, 1, 3])
def test_a_vehicle_without_a_key_gets_one_also_over_a_bad_link(frames_lost: int) -> None:
    vehicle = Vehicle(frames_lost=frames_lost)
    assert load(vehicle, KEY)[0] is Outcome.DONE
    assert vehicle.key == KEY


def test_a_key_is_replaced_with_the_signature_of_the_present_one() -> None:
    vehicle = Vehicle(KEY)
    assert load(vehicle, NEXT_KEY, current=KEY)[0] is Outcome.DONE
    assert vehicle.key == NEXT_KEY


def test_a_vehicle_that_has_the_key_is_left_alone() -> None:
    assert load(Vehicle(KEY), KEY, current=KEY) == (Outcome.ALREADY, 0)


@pytest.mark.parametrize("current", [None, KEY])
def test_a_vehicle_that_signs_with_an_unknown_key_gets_none(current: bytes | None) -> None:
    vehicle = Vehicle(OTHER_KEY)
    assert load(vehicle, KEY, current=current) == (Outcome.OTHER_KEY, 0)
    assert vehicle.key == OTHER_KEY


def test_no_key_is_sent_to_an_armed_vehicle() -> None:
    assert load(Vehicle(armed=True), KEY) == (Outcome.ARMED, 0)


def test_an_autopilot_without_signatures_is_reported() -> None:
    outcome, sent = load(Vehicle(knows_signatures=False), KEY)
    assert outcome is Outcome.UNCONFIRMED
    assert sent >= 2


def test_a_vehicle_that_begins_with_mavlink_1_gets_its_key_once_it_sends_mavlink_2() -> None:
    assert load(Vehicle(version_1=3), KEY)[0] is Outcome.DONE
    assert load(Vehicle(version_1=1000), KEY) == (Outcome.VERSION_1, 0)


def test_a_silent_link_ends_it() -> None:
    assert load(None, KEY) == (Outcome.SILENT, 0)


def test_a_key_is_removed() -> None:
    vehicle = Vehicle(KEY)
    assert load(vehicle, None, current=KEY)[0] is Outcome.DONE
    assert vehicle.key is None


def test_a_key_that_is_not_known_cannot_be_removed() -> None:
    assert load(Vehicle(OTHER_KEY), None, current=KEY) == (Outcome.OTHER_KEY, 0)
