"""The uplink against what is no broker: strange bytes, silence, nobody."""

import gc
import random
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from edge_server.config import Config
from edge_server.outbox.answers import Reply, Unreachable
from edge_server.outbox.queue import Parcel, Stream
from edge_server.outbox.uplink import MOST
from edge_server.uplinks.mqtt import MqttUplink
from tests.support.system import free_ports

WELCOME = bytes([0x20, 3, 0, 0, 0])
PARCELS = [Parcel(1, 1, "one", Stream(1, "pose"), "{}", 0)]


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
    """Listen, and treat each connection as told."""
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
    return [reply for _ in range(times) for reply in uplink.send(PARCELS)]


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
            assert isinstance(reply, Unreachable) or reply.status == 401


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
        assert uplink.offer() == MOST
