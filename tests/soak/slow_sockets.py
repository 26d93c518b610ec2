"""Half-sent requests without a key: connections that drip a byte now and then, for ever."""

import socket
import threading
from collections import Counter
from contextlib import suppress
from random import Random
from typing import Final, Self

_DRIP_S: Final = 3.0
_BEGINNINGS: Final = (
    b"GET /plans/ HTTP/1.1\r\nHost: farm\r\nX-Slow: ",
    b"POST /plans/ HTTP/1.1\r\nHost: farm\r\nContent-Length: 100000\r\n\r\n{",
    b"POST /events/ HTTP/1.1\r\nHost: farm\r\nTransfer-Encoding: chunked\r\n\r\n5",
)


class SlowSockets:
    """Keeps so many connections half-open; who is cut off comes back."""

    def __init__(self, port: int, count: int, seed: int) -> None:
        self._port = port
        self._count = count
        self._random = Random(seed)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.counts: Counter[str] = Counter()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(30.0)

    def _run(self) -> None:
        open_ones: list[socket.socket] = []
        while not self._ended.is_set():
            for each in list(open_ones):
                try:
                    each.send(b"1")
                except OSError:
                    self.counts["cut off"] += 1
                    each.close()
                    open_ones.remove(each)
            while len(open_ones) < self._count:
                try:
                    slow = socket.create_connection(("127.0.0.1", self._port), 2.0)
                    slow.sendall(self._random.choice(_BEGINNINGS))
                    slow.setblocking(False)
                except OSError:
                    self.counts["refused"] += 1
                    break
                open_ones.append(slow)
                self.counts["opened"] += 1
            self._ended.wait(_DRIP_S)
        for each in open_ones:
            with suppress(OSError):
                each.close()
