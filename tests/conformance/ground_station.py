"""A ground station of sockets and codec alone, with a vehicle process to talk to."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from tests.support.system import ROOT
from uav_firmware.module_errors import INTERNAL_ERROR

PATIENCE_S = 60.0
SYSTEM, COMPONENT = 255, 190


@contextmanager
def vehicle_process(
    system_id: int, speed: float, ports: tuple[int, int, int], state: Path
) -> Iterator[None]:
    """Run the autopilot; `ports` are its own, the broker's and the ground station's."""
    own, broker, ground = ports
    arguments = {
        "--system-id": system_id,
        "--speed": speed,
        "--port": own,
        "--broker": f"127.0.0.1:{broker}",
        "--gcs": f"127.0.0.1:{ground}",
        "--state-dir": state,
        "--truth": 1,
    }
    command = [sys.executable, "-m", "uav_firmware"]
    command += [str(part) for pair in arguments.items() for part in pair]
    log_path = state / "vehicle.log"
    with log_path.open("wb") as log:
        process = subprocess.Popen(command, cwd=ROOT, env=os.environ, stdout=log, stderr=log)
    try:
        yield
    finally:
        process.send_signal(signal.SIGTERM)
        code = process.wait(30)
    assert code == 0, log_path.read_text()
    assert INTERNAL_ERROR not in log_path.read_text()


class GroundStation:
    """Says messages, hears messages; keeps the vehicle's newest state."""

    def __init__(
        self, own_port: int, vehicle_port: int, vehicle: int, components: tuple[int, ...] = (1,)
    ) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", own_port))
        self._socket.settimeout(0.05)
        self._to = ("127.0.0.1", vehicle_port)
        self._codec = mavlink.MAVLink(None, SYSTEM, COMPONENT)
        self._codec.robust_parsing = True
        self._heartbeat_s = 0.0
        self.vehicle = vehicle
        self._components = components  # That are listened to
        self.newest: dict[str, Any] = {}

    def close(self) -> None:
        self._socket.close()

    def say(self, message: Any) -> None:
        self._socket.sendto(message.pack(self._codec), self._to)
        self._codec.seq = (self._codec.seq + 1) % 256

    def hear(self) -> list[Any]:
        """What has arrived, after a short wait for something; heartbeats go out by the way."""
        if time.monotonic() - self._heartbeat_s > 1.0:
            self._heartbeat_s = time.monotonic()
            self.say(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        try:
            datagram = self._socket.recv(4096)
        except TimeoutError:
            return []
        messages = [
            m
            for m in self._codec.parse_buffer(datagram) or []
            if m.get_type() != "BAD_DATA"
            and m.get_srcSystem() == self.vehicle
            and m.get_srcComponent() in self._components
        ]
        self.newest |= {m.get_type(): m for m in messages}
        return messages

    def until(self, condition: Callable[[Any], Any], what: str) -> Any:
        """Hear until a message fulfils the condition, and give that message."""
        deadline_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline_s:
            for message in self.hear():
                if condition(message):
                    return message
        raise AssertionError(f"waited {PATIENCE_S:.0f} s for {what}")

    def ask(self, message: Any, answer: str, **fields: Any) -> Any:
        """Say a message and hear the answer of a type with these fields."""
        self.say(message)
        return self.until(
            lambda m: m.get_type() == answer and all(getattr(m, k) == v for k, v in fields.items()),
            f"{answer} {fields}",
        )

    def command(self, number: int, *parameters: float) -> int:
        """COMMAND_LONG; gives the result of its final answer."""
        p = [*parameters, *[0.0] * (7 - len(parameters))]
        message = mavlink.MAVLink_command_long_message(self.vehicle, 1, number, 0, *p)
        return self._final(message, number)

    def command_int(self, number: int, frame: int, *parameters: float) -> int:
        """COMMAND_INT; parameters 5 and 6 are integers."""
        p1, p2, p3, p4, x, y, z = parameters
        message = mavlink.MAVLink_command_int_message(
            self.vehicle, 1, frame, number, 0, 0, p1, p2, p3, p4, int(x), int(y), z
        )
        return self._final(message, number)

    def _final(self, message: Any, number: int) -> int:
        self.say(message)
        answer = self.until(
            lambda m: m.get_type() == "COMMAND_ACK" and m.command == number and m.result != 5,
            f"an answer to {number}",
        )
        return int(answer.result)
