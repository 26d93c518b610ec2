"""A UDP relay between vehicle and broker that notes when a kind of message passes.

It reads nothing but MAVLink 2 headers (start byte, length, message id), so it measures the
wire and not either program's own opinion.
"""

import selectors
import socket
import threading
import time
from typing import Self

MAVLINK_2 = 0xFD
HEADER_BYTES = 10
MISSION_ACK = 47
POSITION = 33
"""GLOBAL_POSITION_INT."""

SIGNED_FLAG = 1


def frames(datagram: bytes) -> list[tuple[int, bytes]]:
    """Split a datagram into (message id, payload) pairs."""
    found = []
    at = 0
    while len(datagram) - at >= HEADER_BYTES + 2 and datagram[at] == MAVLINK_2:
        length = datagram[at + 1]
        number = int.from_bytes(datagram[at + 7 : at + 10], "little")
        found.append((number, datagram[at + HEADER_BYTES : at + HEADER_BYTES + length]))
        at += HEADER_BYTES + length + 2 + (13 if datagram[at + 2] & SIGNED_FLAG else 0)
    return found


class Wiretap:
    """Relays datagrams both ways; `passed` lists (time, message id, payload) from the vehicle."""

    def __init__(self, port: int, broker_port: int) -> None:
        self.passed: list[tuple[float, int, bytes]] = []
        self._broker = ("127.0.0.1", broker_port)
        self._vehicle_side = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._vehicle_side.bind(("127.0.0.1", port))
        self._broker_side = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._broker_side.bind(("127.0.0.1", 0))
        self._vehicle: tuple[str, int] | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._vehicle_side.close()
        self._broker_side.close()

    def _run(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._vehicle_side, selectors.EVENT_READ)
            selector.register(self._broker_side, selectors.EVENT_READ)
            while not self._stop.is_set():
                for key, _ in selector.select(0.2):
                    self._relay(key.fileobj is self._vehicle_side)

    def _relay(self, from_vehicle: bool) -> None:
        try:
            if from_vehicle:
                datagram, self._vehicle = self._vehicle_side.recvfrom(65_535)
                now = time.time()
                self.passed += [(now, number, body) for number, body in frames(datagram)]
                self._broker_side.sendto(datagram, self._broker)
            else:
                datagram = self._broker_side.recv(65_535)
                if self._vehicle is not None:
                    self._vehicle_side.sendto(datagram, self._vehicle)
        except ConnectionRefusedError:
            return  # The other side is not up yet; UDP reports it on the next call.
