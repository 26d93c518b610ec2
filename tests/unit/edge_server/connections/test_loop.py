"""Requests are served despite many slow clients; over loopback sockets."""

import contextlib
import select
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from edge_server.connections import admission, connection, exchange, loop
from edge_server.connections.admission import Limits
from edge_server.connections.counts import ConnectionCounts
from edge_server.connections.exchange import Exchange
from edge_server.connections.loop import ConnectionLoop, Options
from edge_server.connections.stall import StallMonitor, since_boot_s
from tests.support.descriptors import numbers_given_again, open_channels
from tests.support.polling import PATIENCE_S, wait_until

ANSWER = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok"
ABORT = b"POST /events/ HTTP/1.1\r\nHost: a\r\nContent-Length: 2\r\n\r\n{}"
REFUSED = b"HTTP/1.1 503 No\r\n\r\n"
SERVER = "127.0.0.9"
"""Not 127.0.0.1: a program of another test that still asks for a server which has ended would find
this one under a port that was given again, and its connection would count."""
GET = b"GET /plans/ HTTP/1.1\r\nHost: a\r\n\r\n"


def answer(exchange: Exchange) -> bool:
    exchange.sendall(ANSWER)
    return True


class Running:
    """The loop in a thread."""

    def __init__(
        self,
        serve: Callable[[Exchange], bool],
        limits: Limits,
        threads: int,
        tls: ssl.SSLContext | None,
        stalls: StallMonitor | None,
    ) -> None:
        loop.raise_descriptor_limit(4000)
        self.counts = ConnectionCounts()
        listener = socket.create_server((SERVER, 0), backlog=1024)
        self.port = listener.getsockname()[1]
        options = Options(
            threads,
            limits,
            tls,
            lambda status: b"HTTP/1.1 %d No\r\n\r\n" % status,
            lambda key: key != "theirs",
        )
        self.service = ConnectionLoop([listener], serve, options, self.counts, stalls)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def begin(self) -> None:
        self._thread.start()

    def _run(self) -> None:
        self.service.start()
        while not self._ended.is_set():
            self.service.turn(time.monotonic())
        self.service.close()

    def end(self) -> None:
        self._ended.set()
        self.service.wake()
        self._thread.join()

    def connect(self, address: str = "127.0.0.1") -> socket.socket:
        return socket.create_connection(
            (SERVER, self.port), PATIENCE_S, source_address=(address, 0)
        )

    def ask(self, request: bytes, address: str = "127.0.0.1") -> bytes:
        with self.connect(address) as sock:
            sock.sendall(request)
            return sock.recv(4096)


@contextlib.contextmanager
def running(
    serve: Callable[[Exchange], bool] = answer,
    *,
    connections: int = 2000,
    per_address: int = 2000,
    kept_bytes: int = 2**26,
    threads: int = 2,
    tls: ssl.SSLContext | None = None,
    stalls: StallMonitor | None = None,
    before: Callable[[Running], None] = lambda _: None,
) -> Iterator[Running]:
    """The loop; `before` is done when it listens and has not begun."""
    service = Running(serve, Limits(connections, per_address, kept_bytes), threads, tls, stalls)
    before(service)
    service.begin()
    try:
        yield service
    finally:
        service.end()


@pytest.mark.first_case
@pytest.mark.parametrize("per_address", [2000, 64])
def test_a_thousand_slow_clients_do_not_delay_an_answer(per_address: int) -> None:
    beginnings = [
        b"",
        b"G",
        ABORT[:30],
        ABORT[:-1],
        b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\n",
    ]
    with running(per_address=per_address) as service, contextlib.ExitStack() as stack:
        for number in range(1000):
            sock = stack.enter_context(service.connect())
            with contextlib.suppress(ConnectionError):  # It may have been evicted already
                sock.sendall(beginnings[number % len(beginnings)])
        wait_until(lambda: service.counts.open >= min(1000, per_address))
        for _ in range(5):
            assert service.ask(ABORT) == ANSWER
            assert service.ask(GET) == ANSWER
        assert service.counts.open <= per_address


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate and its key; RSA, whose signatures take long."""
    folder = tmp_path_factory.mktemp("tls")
    chain, key = folder / "certificate.pem", folder / "key.pem"
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=127.0.0.1"]
    files = ["-keyout", str(key), "-out", str(chain), "-days", "2"]
    subprocess.run([*command, *files], check=True, capture_output=True)
    return chain, key


def client_hello() -> bytes:
    """A TLS ClientHello."""
    context = ssl.create_default_context()
    received, sent = ssl.MemoryBIO(), ssl.MemoryBIO()
    with contextlib.suppress(ssl.SSLWantReadError):
        context.wrap_bio(received, sent, server_hostname="localhost").do_handshake()
    return sent.read()


def test_an_abort_is_answered_amid_abandoned_handshakes(
    certificate: tuple[Path, Path],
) -> None:
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(*certificate)
    client = ssl.create_default_context(cafile=str(certificate[0]))
    client.check_hostname = False
    hello = client_hello()
    with running(tls=server) as service, contextlib.ExitStack() as stack:
        for number in range(100):
            sock = stack.enter_context(service.connect("127.0.0.2"))
            sock.sendall(hello[: None if number % 2 else 100])
        for address in ("127.0.0.1", "127.0.0.2"):
            with client.wrap_socket(service.connect(address)) as sock:
                sock.sendall(ABORT)
                assert sock.recv(4096) == ANSWER
        assert service.counts.open >= 100


class Beginning(NamedTuple):
    """A TLS connection."""

    network: str
    since: float
    has_been_served: bool = False
    kept_bytes: int = 0


def test_the_newest_handshake_of_every_network_goes_first() -> None:
    many = [Beginning("many", float(second)) for second in range(50)]
    few = [Beginning("few", 3.0), Beginning("few", 9.0)]
    chosen = admission.next_handshakes([*many, *few], 5)
    assert chosen == [few[1], many[49], few[0], many[48], many[47]]


def test_idle_connections_are_evicted_after_silent_ones() -> None:
    with running(per_address=8) as service, contextlib.ExitStack() as stack:
        served = stack.enter_context(service.connect())
        served.sendall(GET)
        assert served.recv(4096) == ANSWER
        for _ in range(30):
            stack.enter_context(service.connect())
        wait_until(lambda: service.counts.closed().get("address_limit", 0) >= 23)
        served.sendall(GET)
        assert served.recv(4096) == ANSWER


def test_the_oldest_idle_connection_is_evicted_for_a_new_one() -> None:
    with running(per_address=8) as service, contextlib.ExitStack() as stack:
        for _ in range(20):
            sock = stack.enter_context(service.connect())
            sock.sendall(GET)
            assert sock.recv(4096) == ANSWER


def test_a_connection_that_was_answered_since_the_last_turn_makes_room() -> None:
    released = threading.Event()

    def serve(exchange: Exchange) -> bool:
        released.wait(PATIENCE_S)
        return answer(exchange)

    service = Running(serve, Limits(10, 1, 2**20), 1, None, None)
    service.service.start()
    with contextlib.closing(service.service), service.connect() as first:
        first.sendall(GET)
        service.service.turn(time.monotonic())
        released.set()
        assert first.recv(4096) == ANSWER
        with service.connect() as second:
            second.sendall(GET)
            while not select.select([second], [], [], 0.0)[0]:
                service.service.turn(time.monotonic())
            assert second.recv(4096) == ANSWER


def test_an_address_cannot_use_up_the_connections_of_others() -> None:
    with running(connections=40, per_address=10) as service, contextlib.ExitStack() as stack:
        other = stack.enter_context(service.connect("127.0.0.2"))
        other.sendall(ABORT[:-1])
        wait_until(lambda: service.counts.open == 1)
        for _ in range(100):
            stack.enter_context(service.connect("127.0.0.1"))
        wait_until(lambda: service.counts.closed().get("address_limit", 0) >= 90)
        other.sendall(ABORT[-1:])
        assert other.recv(4096) == ANSWER


def test_an_abort_is_answered_while_all_general_threads_are_busy() -> None:
    released = threading.Event()

    def serve(exchange: Exchange) -> bool:
        if exchange.recv(4) != b"POST":
            released.wait(PATIENCE_S)
        return answer(exchange)

    with running(serve, threads=2) as service, contextlib.ExitStack() as stack:
        held = [stack.enter_context(service.connect()) for _ in range(20)]
        for sock in held:
            sock.sendall(GET)
        assert service.ask(ABORT) == ANSWER
        released.set()
        assert {sock.recv(4096) for sock in held} == {ANSWER}


def test_a_request_without_a_key_does_not_occupy_the_threads_of_aborts() -> None:
    """While the database stalls, and no request can be refused."""
    released = threading.Event()

    def serve(exchange: Exchange) -> bool:
        if b"theirs" in exchange.recv(100):
            released.wait(PATIENCE_S)
        return answer(exchange)

    strange = ABORT[:-6] + b"\r\nX-API-Key: theirs\r\n\r\n{}"
    with running(serve, threads=2) as service, contextlib.ExitStack() as stack:
        stack.callback(released.set)
        for _ in range(20):
            stack.enter_context(service.connect()).sendall(strange)
        wait_until(lambda: service.counts.open == 20)
        assert service.ask(ABORT) == ANSWER
        assert service.ask(b"GET /broker/commands HTTP/1.1\r\nHost: a\r\n\r\n") == ANSWER


@pytest.mark.thorough
def test_a_head_and_a_body_have_a_deadline_for_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "HEAD_S", 0.3)
    monkeypatch.setattr(connection, "BODY_S", 0.6)
    with running() as service:
        for start, reason in (
            (b"GET / HTTP/1.1\r\nHost: a\r\nX: ", "slow_head"),
            (ABORT[:-2], "slow_body"),
        ):
            with service.connect() as sock:
                sock.sendall(start)
                with contextlib.suppress(ConnectionError):
                    for _ in range(2000):  # A byte at a time, in time for any timeout between two
                        sock.sendall(b"x" if reason == "slow_head" else b"")
                        if service.counts.closed().get(reason):
                            break
                        time.sleep(0.005)
                assert sock.recv(4096).startswith(b"HTTP/1.1 408")
            assert service.counts.closed()[reason] == 1


def test_a_silent_connection_is_closed_without_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "HEAD_S", 0.1)
    with running() as service, service.connect() as sock:
        assert sock.recv(4096) == b""
        assert service.counts.closed() == {"slow_head": 1}


@pytest.mark.parametrize("length", range(1, len(ABORT)))
def test_a_request_that_ends_before_it_is_complete_is_answered(length: int) -> None:
    with running() as service, service.connect() as sock:
        sock.sendall(ABORT[:length])
        sock.shutdown(socket.SHUT_WR)
        assert sock.recv(4096).startswith(b"HTTP/1.1 400")
        wait_until(lambda: service.counts.open == 0)


def test_memory_is_bounded_and_the_oldest_request_is_dropped() -> None:
    with running(kept_bytes=500_000) as service, contextlib.ExitStack() as stack:
        head = b"POST /pose/ HTTP/1.1\r\nHost: a\r\nContent-Length: 300000\r\n\r\n"
        first = stack.enter_context(service.connect())
        first.sendall(head + b"x" * 290_000)
        wait_until(lambda: service.counts.open == 1)
        second = stack.enter_context(service.connect())
        second.sendall(head + b"x" * 290_000)
        wait_until(lambda: service.counts.closed() == {"memory": 1})
        second.sendall(b"x" * 10_000)
        assert second.recv(4096) == ANSWER


def test_the_oldest_of_requests_that_were_accepted_together_are_dropped() -> None:
    clients: list[socket.socket] = []
    head = b"POST /pose/ HTTP/1.1\r\nHost: a\r\nContent-Length: 20000\r\n\r\n"

    def connect(service: Running) -> None:
        for _ in range(8):
            clients.append(service.connect())
            clients[-1].sendall(head + b"x" * 19_000)

    with running(kept_bytes=100_000, before=connect) as service, contextlib.ExitStack() as stack:
        for client in clients:
            stack.enter_context(client)
        wait_until(lambda: service.counts.closed() == {"memory": 3})
        for client in clients[3:]:
            client.sendall(b"x" * 1_000)
            assert client.recv(4096) == ANSWER


def test_waiting_requests_are_bounded_and_events_keep_their_share() -> None:
    """While no thread comes back, as with a database that stalls."""
    released = threading.Event()

    def serve(exchange: Exchange) -> bool:
        released.wait(PATIENCE_S)
        return answer(exchange)

    body = b"x" * 40_000
    picture = b"POST /image/ HTTP/1.1\r\nHost: a\r\nContent-Length: 40000\r\n\r\n" + body
    with running(serve, kept_bytes=400_000) as service, contextlib.ExitStack() as stack:
        stack.callback(released.set)
        pictures = [stack.enter_context(service.connect()) for _ in range(30)]
        for sock in pictures:
            sock.sendall(picture)
        wait_until(lambda: service.counts.closed().get("busy", 0) >= 23)
        event, poll = (stack.enter_context(service.connect()) for _ in range(2))
        event.sendall(ABORT)
        poll.sendall(b"GET /broker/commands HTTP/1.1\r\nHost: a\r\n\r\n")
        assert service.ask(picture) == REFUSED
        released.set()
        assert event.recv(4096) == ANSWER
        assert poll.recv(4096) == ANSWER
        answers = [sock.recv(4096) for sock in pictures]
        assert answers.count(ANSWER) == 7  # Of 300 000 bytes
        assert answers.count(REFUSED) == 23
        wait_until(lambda: service.ask(picture) == ANSWER)  # There is room again


def test_pipelined_requests_are_answered_in_order() -> None:
    def serve(exchange: Exchange) -> bool:
        line = exchange.recv(100).split(b" ")[1]
        exchange.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%b" % (len(line), line))
        return True

    with running(serve) as service, service.connect() as sock:
        sock.sendall(
            b"".join(b"GET /%d HTTP/1.1\r\nHost: a\r\n\r\n" % number for number in range(20))
        )
        received = b""
        while not received.endswith(b"/19"):
            received += sock.recv(4096)
        assert [part[-2:] for part in received.split(b"HTTP/1.1 200 OK")][1:3] == [b"/0", b"/1"]
        assert received.count(b"HTTP/1.1 200 OK") == 20


def test_a_client_that_does_not_read_its_answer_times_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(exchange, "SEND_S", 0.2)
    given_up = threading.Event()

    def serve(exchange: Exchange) -> bool:
        if exchange.recv(6) != b"GET /l":
            return answer(exchange)
        try:
            exchange.sendall(b"x" * 50_000_000)
        except OSError:
            given_up.set()
        return False

    with running(serve, threads=1) as service, service.connect() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.sendall(b"GET /large HTTP/1.1\r\nHost: a\r\n\r\n")
        assert given_up.wait(PATIENCE_S)
        assert service.ask(GET) == ANSWER


def test_an_answer_is_not_lost_when_its_client_still_sends() -> None:
    def refuse(exchange: Exchange) -> bool:
        exchange.sendall(b"HTTP/1.1 413 Too Large\r\nContent-Length: 0\r\n\r\n")
        return False

    with running(refuse) as service, service.connect() as sock:
        sock.sendall(b"POST /pose/ HTTP/1.1\r\nHost: a\r\nContent-Length: 5000000\r\n\r\n")
        for _ in range(100):
            sock.sendall(b"x" * 50_000)
        assert sock.recv(4096).startswith(b"HTTP/1.1 413")


def test_a_head_without_end_is_answered_with_the_reason() -> None:
    def refuse(exchange: Exchange) -> bool:
        exchange.sendall(b"HTTP/1.1 %d No\r\nContent-Length: 0\r\n\r\n" % (exchange.refusal or 200))
        return False

    with running(refuse) as service, service.connect() as sock:
        sock.sendall(b"GET / HTTP/1.1\r\nHost: a\r\nA: ")
        for _ in range(40):
            sock.sendall(b"x" * 500_000)
        assert sock.recv(4096).startswith(b"HTTP/1.1 431")


def test_a_client_that_expects_100_continue_receives_it() -> None:
    with running() as service, service.connect() as sock:
        sock.sendall(
            b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nExpect: 100-continue\r\n\r\n"
        )
        assert sock.recv(4096) == b"HTTP/1.1 100 Continue\r\n\r\n"
        sock.sendall(b"x")
        assert sock.recv(4096) == ANSWER


class Numbers:
    """A stream of numbered lines, each as long as is asked for; it ends when the test chooses."""

    def __init__(self, length: int) -> None:
        self._length = length
        self.taken = 0
        self.is_over = False

    def take(self, _now: float) -> bytes | None:
        if self.is_over:
            return None
        self.taken += 1
        return b"%d" % self.taken + b"." * self._length + b"\n"


def streaming(stream: Numbers) -> Callable[[Exchange], bool]:
    def serve(exchange: Exchange) -> bool:
        exchange.begin_stream(b"HTTP/1.1 200 OK\r\n\r\n", stream)
        exchange.sendall(b"what the view returns")
        return False

    return serve


def lines(sock: socket.socket, count: int) -> list[bytes]:
    with sock.makefile("rb") as received:
        while received.readline() != b"\r\n":
            pass
        return [received.readline().removesuffix(b"\n") for _ in range(count)]


@pytest.mark.parametrize("length", [10, 5_000_000])
def test_a_stream_arrives_whole_and_in_order_however_long_its_parts_are(length: int) -> None:
    stream = Numbers(length)
    with running(streaming(stream)) as service, service.connect() as sock:
        sock.sendall(GET)
        found = lines(sock, 3)
        assert [line.rstrip(b".") for line in found] == [b"1", b"2", b"3"]
        assert {len(line) for line in found} == {length + 1}
        stream.is_over = True
        while sock.recv(65_536):
            pass
        wait_until(lambda: service.counts.open == 0)


def test_a_reader_that_does_not_read_keeps_one_part_and_no_thread() -> None:
    stream = Numbers(5_000_000)
    with running(streaming(stream), threads=1) as service, contextlib.ExitStack() as stack:
        for _ in range(3):
            stack.enter_context(service.connect()).sendall(GET)
        wait_until(lambda: service.counts.open == 3)
        assert service.ask(GET)[:15] == b"HTTP/1.1 200 OK"
        taken = stream.taken
        for _ in range(5):
            service.ask(GET)
        assert stream.taken - taken <= 2 * 5 + 8  # The new readers', not those who do not read


def test_a_stream_is_asked_when_something_is_new_and_not_at_each_request(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(loop, "_SWEEP_S", PATIENCE_S)
    stream = Numbers(10)
    serves = iter([answer, streaming(stream)])

    def serve(exchange: Exchange) -> bool:
        return next(serves, answer)(exchange)

    with running(serve) as service:
        assert service.ask(GET) == ANSWER  # The first sweep, which asks every stream, is over
        with service.connect() as reader, reader.makefile("rb") as received:
            reader.sendall(GET)
            while received.readline() != b"\r\n":
                pass
            assert received.readline().startswith(b"1.")
            assert service.ask(GET) == ANSWER  # It may be asked once more as it begins
            taken = stream.taken
            for _ in range(20):
                assert service.ask(GET) == ANSWER
            assert stream.taken == taken
            service.service.wake_streams()
            for number in range(2, taken + 2):
                assert received.readline().startswith(b"%d." % number)
            stream.is_over = True


@pytest.mark.parametrize("cut", [0, 1, len(GET) - 1])
def test_a_reader_that_leaves_is_forgotten(cut: int) -> None:
    stream = Numbers(10)
    with running(streaming(stream)) as service:
        with service.connect() as sock:
            sock.sendall(GET[: len(GET) - cut])
            if not cut:
                sock.recv(10)
        wait_until(lambda: service.counts.open == 0)
        stream.is_over = True


def test_a_closed_loop_leaves_nothing_open_and_is_woken_without_effect() -> None:
    before = open_channels()
    with running() as service:
        assert service.ask(GET) == ANSWER
    wait_until(lambda: open_channels() <= before)
    with numbers_given_again():
        service.service.wake()  # As a request does that is served after the end


def test_a_request_that_is_read_behind_a_pause_may_have_waited_as_long() -> None:
    """The clock of the loop jumps, as after a suspension."""
    late_s = [61.0]
    waited_s: list[float] = []

    def serve(exchange: Exchange) -> bool:
        waited_s.append(exchange.waited_s)
        return answer(exchange)

    with running(serve, stalls=StallMonitor(lambda: since_boot_s() - late_s[0])) as service:
        late_s[0] = 0.0
        assert service.ask(ABORT) == ANSWER
    assert waited_s[0] > 60.0
