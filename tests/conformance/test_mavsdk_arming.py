"""What MAVSDK sends for the actions that arm and disarm, to a vehicle that only listens.

`docs/how-to/connect-a-ground-station.md` warns of `arm_force`. When that test fails, MAVSDK has
been corrected: remove the warning there and in `docs/reference/conformance.md`.
"""

import math
import socket
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from pymavlink.dialects.v20 import common as mavlink

from tests.support.system import free_ports, wait_for

pytestmark = pytest.mark.scenario

FORCE = 21196.0
"""Second parameter that arms or disarms without checks, also in flight."""
HOLD_MODE = 4 << 16 | 3 << 24


class Listener:
    """Sends heartbeats as a PX4 in the air, accepts every command and keeps those to arm."""

    def __init__(self, port: int) -> None:
        self._client = "127.0.0.1", port
        self._codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._codec.robust_parsing = True
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.2)
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self.orders: list[tuple[float, float]] = []
        self._thread.start()

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()
        self._socket.close()

    def _serve(self) -> None:
        while not self._is_over.is_set():
            mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            self._send(mavlink.MAVLink_heartbeat_message(2, 12, mode, HOLD_MODE, 4, 3))
            self._send(mavlink.MAVLink_extended_sys_state_message(0, 2))
            try:
                received = self._codec.parse_buffer(self._socket.recv(2048))
            except TimeoutError:
                continue
            for message in received or []:
                if message.get_type() in {"COMMAND_LONG", "COMMAND_INT"}:
                    self._accept(message)

    def _accept(self, message: Any) -> None:
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.orders.append((message.param1, message.param2))
        source = message.get_srcSystem(), message.get_srcComponent()
        self._send(mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, *source))

    def _send(self, message: Any) -> None:
        self._socket.sendto(message.pack(self._codec), self._client)


@pytest.fixture(scope="module")
def listener() -> Iterator[tuple[Listener, Any]]:
    """The listener, and MAVSDK's actions on it."""
    (port,) = free_ports(1)
    made = Listener(port)
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
    try:
        system = wait_for(lambda: sdk.first_autopilot(timeout_s=5.0), "MAVSDK's discovery")
        yield made, Action(system)
    finally:
        made.close()
        sdk.destroy()


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("arm", (1.0, math.nan)),
        ("disarm", (0.0, math.nan)),
        ("kill", (0.0, FORCE)),
        ("arm_force", (0.0, FORCE)),  # Of MAVSDK 4.1.0: the same order as kill; meant is 1
    ],
)
def test_an_action_sends_these_parameters(
    name: str, parameters: tuple[float, float], listener: tuple[Listener, Any]
) -> None:
    made, action = listener
    made.orders.clear()
    getattr(action, name)()
    assert made.orders[0] == pytest.approx(parameters, nan_ok=True)
