"""Pilots who take vehicles over from the broker, and give them back when it pleases them.

One ground station receives all vehicles. While a pilot has one, its mode is his: no other may
change it. He centres the sticks (the vehicle hovers), and at the end orders a return.
"""

import socket
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from random import Random
from typing import Final, Self

from pymavlink.dialects.v20 import common

POSITION_CONTROL: Final = 3  # PX4's main mode POSCTL
_AUTO, _RETURN = 4, 5
_SYSTEM, _COMPONENT = 255, 190
_HEARTBEAT_S: Final = 1.0
_STICKS_S: Final = 0.1
_HOLD_S: Final = (10.0, 40.0)
_SETTLE_S: Final = 3.0
_ARMED: Final[int] = common.MAV_MODE_FLAG_SAFETY_ARMED


@dataclass(slots=True)
class _Seen:
    """What was last received of a vehicle."""

    address: tuple[str, int]
    main_mode: int = 0
    sub_mode: int = 0
    texts: deque[str] = field(default_factory=lambda: deque(maxlen=5))
    armed: bool = False
    in_failsafe: bool = False
    height_m: float = 0.0
    at_s: float = 0.0


@dataclass(slots=True)
class Takeover:
    """One vehicle in a pilot's hands."""

    system: int
    began_s: float
    until_s: float
    has_it: bool = False
    lost_to_mode: int | None = None  # Main mode that another system has put it in
    in_failsafe: bool = False  # Then the vehicle itself, for instance without the sticks
    texts: tuple[str, ...] = ()  # The last ones at that moment


class Pilots:
    """At most one takeover at a time, begun by `take`; those that have ended are in `done`."""

    def __init__(self, port: int, seed: int) -> None:
        """Listen as the ground station on a UDP port."""
        self.done: list[Takeover] = []
        self.current: Takeover | None = None
        self._random = Random(seed)
        self._codec = common.MAVLink(None, srcSystem=_SYSTEM, srcComponent=_COMPONENT)
        self._codec.robust_parsing = True
        self._seen: dict[int, _Seen] = {}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.settimeout(0.02)
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(10.0)
        self._socket.close()

    def take(self, lowest_m: float = 2.0) -> int | None:
        """Take some flying vehicle over, if there is one and the pilot's hands are free."""
        with self._lock:
            flying = [
                system
                for system, seen in self._seen.items()
                if seen.armed and seen.height_m > lowest_m and time.monotonic() - seen.at_s < 3.0
            ]
            if self.current is not None or not flying:
                return None
            system, now = self._random.choice(flying), time.monotonic()
            self.current = Takeover(system, now, now + self._random.uniform(*_HOLD_S))
            return system

    def armed(self) -> set[int]:
        """Vehicles that are armed, as far as is known."""
        with self._lock:
            return {system for system, seen in self._seen.items() if seen.armed}

    def describe(self, system: int) -> str:
        """What was last received of a vehicle."""
        with self._lock:
            seen = self._seen[system]
            age_s = time.monotonic() - seen.at_s
            return (
                f"vehicle {system}, PX4 mode {seen.main_mode}.{seen.sub_mode}, "
                f"{seen.height_m:.1f} m above home, {age_s:.0f} s ago; {'; '.join(seen.texts)}"
            )

    def _run(self) -> None:
        heartbeat_s = sticks_s = 0.0
        while not self._ended.is_set():
            self._receive()
            now = time.monotonic()
            if now - heartbeat_s >= _HEARTBEAT_S:
                heartbeat_s = now
                kind, none = common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID
                for seen in self._seen.values():
                    self._send(common.MAVLink_heartbeat_message(kind, none, 0, 0, 4, 3), seen)
            if now - sticks_s >= _STICKS_S:
                sticks_s = now
                with self._lock:
                    self._fly(now)

    def _receive(self) -> None:
        try:
            datagram, address = self._socket.recvfrom(2048)
        except TimeoutError:
            return
        for message in self._codec.parse_buffer(datagram) or ():
            with self._lock:
                self._note(message, address)

    def _note(self, message: common.MAVLink_message, address: tuple[str, int]) -> None:
        system = message.get_srcSystem()
        seen = self._seen.setdefault(system, _Seen(address))
        seen.address, seen.at_s = address, time.monotonic()
        if message.get_type() == "STATUSTEXT":
            seen.texts.append(message.text)
        if message.get_type() == "GLOBAL_POSITION_INT":
            seen.height_m = message.relative_alt * 1e-3
        if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == 1:
            seen.main_mode = message.custom_mode >> 16 & 0xFF
            seen.sub_mode = message.custom_mode >> 24 & 0xFF
            seen.armed = bool(message.base_mode & _ARMED)
            seen.in_failsafe = message.system_status >= common.MAV_STATE_CRITICAL
            self._watch(system, seen)

    def _watch(self, system: int, seen: _Seen) -> None:
        """Whether the vehicle is still in the mode that its pilot has chosen."""
        current = self.current
        if current is None or current.system != system or not seen.armed:
            return
        if seen.main_mode == POSITION_CONTROL:
            current.has_it = True
        elif current.has_it and current.lost_to_mode is None:
            current.lost_to_mode = seen.main_mode
            current.in_failsafe, current.texts = seen.in_failsafe, tuple(seen.texts)

    def _fly(self, now_s: float) -> None:
        current = self.current
        if current is None:
            return
        seen = self._seen[current.system]
        if now_s < current.until_s and seen.armed:
            if not current.has_it and now_s - current.began_s < _SETTLE_S:
                self._command(common.MAV_CMD_DO_SET_MODE, current.system, POSITION_CONTROL, 0)
            sticks = common.MAVLink_manual_control_message(current.system, 0, 0, 500, 0, 0)
            self._send(sticks, seen)
            return
        self.done.append(current)
        self.current = None
        self._command(common.MAV_CMD_DO_SET_MODE, current.system, _AUTO, _RETURN)

    def _command(self, command: int, system: int, main: int, sub: int) -> None:
        mode = float(common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        message = common.MAVLink_command_long_message(
            system, 1, command, 0, mode, float(main), float(sub), 0, 0, 0, 0
        )
        self._send(message, self._seen[system])

    def _send(self, message: common.MAVLink_message, to: _Seen) -> None:
        self._socket.sendto(message.pack(self._codec), to.address)
