"""A TCP proxy that spoils answers: cut off at any byte, stalled, garbled, reset, or left alone."""

import socket
import threading
from collections import Counter
from contextlib import suppress
from random import Random
from typing import Final, Self

_CHUNK: Final = 65_536
_ANSWER_BYTES: Final = 400
"""An answer of the mock cloud is about so long; what is cut is cut inside it."""
_STALL_S: Final = 60.0


class CuttingProxy:
    """Passes connections on to a port of this machine, and spoils a share of the answers."""

    def __init__(self, to_port: int, seed: int, *, share: float) -> None:
        self._to_port = to_port
        self._random = Random(seed)
        self._share = share
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        self.counts: Counter[str] = Counter()
        self._ended = threading.Event()

    def __enter__(self) -> Self:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.share_off()
        self._listening.close()

    def share_off(self) -> None:
        """Spoil nothing more, also what is stalled now."""
        self._share = 0.0
        self._ended.set()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listening.accept()
                threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client, suppress(OSError):
            try:
                server = socket.create_connection(("127.0.0.1", self._to_port), 10.0)
            except OSError:
                self.counts["cloud away"] += 1
                return
            with server:
                threading.Thread(target=_pass_on, args=(client, server), daemon=True).start()
                self._answer(server, client)

    def _answer(self, server: socket.socket, client: socket.socket) -> None:
        while chunk := server.recv(_CHUNK):
            if self._random.random() >= self._share:
                self.counts["whole"] += 1
                client.sendall(chunk)
                continue
            fault = self._random.choice(("cut", "stalled", "garbled", "reset"))
            self.counts[fault] += 1
            part = chunk[: self._random.randrange(min(len(chunk), _ANSWER_BYTES))]
            if fault == "garbled":
                spoilt = bytearray(chunk)
                for _ in range(5):
                    spoilt[self._random.randrange(len(spoilt))] = self._random.randrange(256)
                client.sendall(spoilt)
                continue
            client.sendall(part)
            if fault == "stalled":
                self._ended.wait(_STALL_S)
            if fault == "reset":
                linger = (1).to_bytes(4, "little") + bytes(4)
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
            return


def _pass_on(source: socket.socket, to: socket.socket) -> None:
    with suppress(OSError):
        while chunk := source.recv(_CHUNK):
            to.sendall(chunk)
        to.shutdown(socket.SHUT_WR)
