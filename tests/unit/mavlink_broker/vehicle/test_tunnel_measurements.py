"""Observations in TUNNEL messages: valid ones are decoded, others are ignored."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.vehicle.alarms import PARAMETERS_HOLD_S, AlarmMonitor
from mavlink_broker.vehicle.measurements import (
    ALARM_PARAMETERS,
    OBSERVATION,
    Observations,
    TunnelObservation,
    alarm_parameters,
    tunnel_observation,
)
from mavlink_broker.vehicle.telemetry import Position, Snapshot


def tunnel(payload: bytes, kind: int = OBSERVATION) -> Message:
    """A message as it comes from the wire."""
    sent = mavlink.MAVLink_tunnel_message(
        0, 0, kind, min(len(payload), 255), list(payload[:128].ljust(128, b"\0"))
    )
    (received,) = Decoder().decode(Encoder(7, 1).encode(sent))
    return received


def texts(*fields: Any) -> Message:
    return tunnel(json.dumps(fields, ensure_ascii=False).encode())


short = st.text(st.characters(categories=["L", "N", "P"], max_codepoint=0x7F), min_size=1)


@given(
    short.map(lambda text: text[:20]),
    short.map(lambda text: text[:20]),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
    short.map(lambda text: text[:20]),
)
def test_an_observation_is_decoded(who: str, what: str, value: float, unit: str) -> None:
    message = texts(who, what, value, unit)
    if message.payload_length <= 128:
        assert tunnel_observation(message) == TunnelObservation(who, what, value, unit)


@pytest.mark.parametrize(
    "fields",
    [
        [],
        ["a", "b", 1.0],
        ["a", "b", "1", "C"],
        ["a", "b", True, "C"],
        ["a", "b", None, "C"],
        ["", "b", 1.0, "C"],
        ["a", "b\n", 1.0, "C"],
        [1, "b", 1.0, "C"],
        ["a", "b", 1.0, "C", "more"],
    ],
)
def test_what_is_no_observation_is_nothing(fields: list[Any]) -> None:
    assert tunnel_observation(texts(*fields)) is None


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"\xff" * 128,
        b'["a","b",1.0,"C"',
        b'["a","b",NaN,"C"]',
        b'["a","b",1e999,"C"]',
        b'["a","b",' + b"9" * 100 + b',"C"]',
        b"[" * 128,
        b'{"a": 1}',
    ],
)
def test_hostile_bytes_do_no_harm(payload: bytes) -> None:
    found = tunnel_observation(tunnel(payload))
    assert found is None or found.value == float("9" * 100)


@given(st.binary(max_size=128), st.integers(0, 255))
def test_no_bytes_do_harm(payload: bytes, length: int) -> None:
    message = tunnel(payload)
    message.payload_length = length
    tunnel_observation(message)
    message.payload_type = ALARM_PARAMETERS
    alarm_parameters(message)


def test_other_tunnels_are_not_meant() -> None:
    assert tunnel_observation(tunnel(b'["a","b",1.0,"C"]', kind=1)) is None


def test_its_own_resource_id_and_unit_reach_the_list() -> None:
    snapshot = Snapshot(position=Position(40.0, -3.0, 5.0, 0.0), time_s=10.0)
    observations = Observations()
    observations.take(texts("probe 7", "soil moisture", 12.5, "% vol"), snapshot, 1.0)
    (found,) = observations.lists(snapshot, 1.0, vehicle_id=7, sequence_number=0)
    (observation,) = found.observation_array
    assert observation.resource_id == "probe 7"
    assert observation.observed_property == "soil moisture"
    assert (observation.result_value, observation.result_uom) == (12.5, "% vol")


def parameters(text: bytes) -> Message:
    return tunnel(text, kind=ALARM_PARAMETERS)


def test_parameters_of_an_alarm_are_two_numbers() -> None:
    assert alarm_parameters(parameters(b"[0.5,-2]")) == (0.5, -2.0)
    for text in (b"[1]", b"[1,2,3]", b'["1",2]', b"[true,2]", b"[NaN,1]", b"[1,1e999]", b"{}"):
        assert alarm_parameters(parameters(text)) is None
    assert alarm_parameters(texts("a", "b", 1.0, "C")) is None


def test_parameters_of_an_alarm_are_given_once_and_not_for_ever() -> None:
    watch = AlarmMonitor()
    watch.receive(parameters(b"[0.5,-2]"), 10.0)
    assert watch.take_parameters(12.0) == (0.5, -2.0)
    assert watch.take_parameters(12.0) == (0.0, 0.0)
    watch.receive(parameters(b"[0.5,-2]"), 20.0)
    assert watch.take_parameters(21.0 + PARAMETERS_HOLD_S) == (0.0, 0.0)
