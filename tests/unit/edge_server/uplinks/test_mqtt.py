"""The uplink against what is no broker: strange bytes, silence, nobody."""

import gc
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from edge_server.config import Config
from edge_server.outbox.answers import Answer, Reply, Unreachable
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.outbox.uplink import MAXIMUM_BATCH
from edge_server.uplinks.mqtt import MqttUplink
from tests.support.descriptors import many_open_files
from tests.support.system import free_ports

WELCOME = bytes([0x20, 3, 0, 0, 0])
GRANTED = bytes([0x90, 4, 0, 1, 0, 1])
RECORDS = [OutboxRecord(1, 1, "one", Stream(1, "pose"), "{}", 0)]


@contextmanager
def uplink_to(url: str, folder: Path) -> Iterator[MqttUplink]:
    config = Config(
        state_dir=folder,
        cloud_url=url,
        connect_timeout_s=0.2,
        read_timeout_s=0.2,
        backoff_base_s=0.01,
        backoff_cap_s=0.01,
    )
    config.edge_dir.mkdir(exist_ok=True)
    uplink = MqttUplink(config)
    try:
        yield uplink
    finally:
        uplink.close()


@contextmanager
def stranger(speak: Callable[[socket.socket], None]) -> Iterator[str]:
    """Listen, and treat each connection as the test chooses."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    with connection, suppress(OSError):
                        speak(connection)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"mqtt://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
    thread.join()


def descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def replies(uplink: MqttUplink, times: int) -> list[Reply]:
    return [reply for _ in range(times) for reply in uplink.send(RECORDS)]


def test_hostile_bytes_become_reasons(tmp_path: Path) -> None:
    draw = random.Random(1)

    def speak(connection: socket.socket) -> None:
        connection.recv(4096)
        if draw.random() < 0.7:
            connection.sendall(WELCOME)
            connection.recv(4096)
        body = draw.randbytes(draw.randrange(40))
        connection.sendall(bytes([draw.randrange(256), len(body)]) + body)

    with stranger(speak) as url, uplink_to(url, tmp_path) as uplink:
        for reply in replies(uplink, 100):
            assert not isinstance(reply, Answer) or reply.status == 401


def test_a_broker_that_says_nothing_is_a_reason(tmp_path: Path) -> None:
    ended = threading.Event()

    def say_nothing(_: socket.socket) -> None:
        ended.wait(20.0)

    with stranger(say_nothing) as url, uplink_to(url, tmp_path) as uplink:
        assert all(isinstance(reply, Unreachable) for reply in replies(uplink, 2))
        ended.set()


@pytest.mark.parametrize("host", ["127.0.0.1", "a" * 70, "nowhere.invalid", "a..b"])
def test_nobody_there_is_a_reason_and_leaves_nothing_open(host: str, tmp_path: Path) -> None:
    with uplink_to(f"mqtt://{host}:{free_ports(1)[0]}", tmp_path) as uplink:
        replies(uplink, 1)
        gc.disable()
        try:
            before = descriptors()
            assert all(isinstance(reply, Unreachable) for reply in replies(uplink, 20))
            assert descriptors() <= before + 3
        finally:
            gc.enable()


def test_after_its_end_it_takes_nothing_and_says_so(tmp_path: Path) -> None:
    with uplink_to(f"mqtt://127.0.0.1:{free_ports(1)[0]}", tmp_path) as uplink:
        uplink.close()
        assert isinstance(replies(uplink, 1)[0], Unreachable)
        assert uplink.batch_limit() == MAXIMUM_BATCH


def answer_packet() -> bytes:
    """A PUBLISH of MQTT 5, QoS 0, that answers the record (MQTT 5.0 section 3.3)."""
    topic, payload = b"answers", b'{"status": 200}'
    properties = b"\x09\x00\x03one" + b"\x26\x00\x0cAccept-Batch\x00\x0250"
    body = b"\x00\x07" + topic + bytes([len(properties)]) + properties + payload
    return bytes([0x30, len(body)]) + body


def broker(
    next_answer: Callable[[], bytes], end: Callable[[socket.socket], None]
) -> Callable[[socket.socket], None]:
    """Welcome a gateway, grant its subscription, answer what it publishes, then end so."""

    def speak(connection: socket.socket) -> None:
        connection.settimeout(5.0)
        for part in (WELCOME, GRANTED):
            connection.recv(4096)
            connection.sendall(part)
        received = b""
        while b"one" not in received:  # The record's own key
            if not (part := connection.recv(4096)):
                return
            received += part
        connection.sendall(next_answer())
        end(connection)

    return speak


def close_at_once(_: socket.socket) -> None:
    """Say nothing more."""


def test_a_whole_answer_confirms(tmp_path: Path) -> None:
    with stranger(broker(answer_packet, close_at_once)) as url, uplink_to(url, tmp_path) as uplink:
        (reply,) = replies(uplink, 1)
        assert isinstance(reply, Answer)
        assert reply.status == 200


def test_a_whole_answer_confirms_where_many_files_are_open(tmp_path: Path) -> None:
    with (
        stranger(broker(answer_packet, close_at_once)) as url,
        many_open_files(),
        uplink_to(url, tmp_path) as uplink,
    ):
        assert isinstance(replies(uplink, 1)[0], Answer)


def test_an_answer_cut_at_any_byte_is_a_reason(tmp_path: Path) -> None:
    whole = answer_packet()
    parts = iter([whole[:length] for length in range(len(whole))])
    with (
        stranger(broker(lambda: next(parts), close_at_once)) as url,
        uplink_to(url, tmp_path) as uplink,
    ):
        for reply in replies(uplink, len(whole)):
            assert isinstance(reply, Unreachable)


def test_an_answer_with_any_byte_broken_ends_nothing(tmp_path: Path) -> None:
    whole = answer_packet()
    broken = [
        whole[:place] + bytes([value]) + whole[place + 1 :]
        for place in range(len(whole))
        for value in (0, 0x7F, 0xFF, whole[place] ^ 1)
    ]
    parts = iter(broken)
    with (
        stranger(broker(lambda: next(parts, whole), close_at_once)) as url,
        uplink_to(url, tmp_path) as uplink,
    ):
        for reply in replies(uplink, len(broken)):
            assert isinstance(reply, Answer | Unreachable)


@pytest.mark.first_case
@pytest.mark.parametrize(
    "start", [b"\x30\xff\xff\xff\x7f", b"\x30\xff\x7f", b"\x30\x7f\x00\x07answers"]
)
def test_a_packet_without_end_is_given_up(start: bytes, tmp_path: Path) -> None:
    """One byte at a time, each in time for any timeout that begins again with a byte."""
    gone = threading.Event()

    def drip(connection: socket.socket) -> None:
        try:
            for _ in range(4000):
                connection.sendall(b"x")
                time.sleep(0.005)
        except OSError:
            gone.set()
            raise

    with stranger(broker(lambda: start, drip)) as url, uplink_to(url, tmp_path) as uplink:
        assert isinstance(replies(uplink, 1)[0], Unreachable)
        assert gone.wait(15.0)
