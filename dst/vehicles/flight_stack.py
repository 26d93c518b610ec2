"""The project's own flight stack on JSBSim as a vehicle of a world, stepped on its clock.

What it did is judged by the simulator's truth and by the frames that went in and out, not by what
the flight stack believes. A vehicle that was broken is a new one at home after its restart.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

import uav_firmware  # noqa: F401  # First: it chooses the compiled modules where there are any
from dst.scheduler import EPOCH, Event, Scheduler
from dst.vehicles.autopilot import ORDERS, OWN, REPORTED_FROM_M, Mode
from dst.vehicles.flight import HOME, Arming, OrderUnderPilot, Reached, Truth, offset_m
from sim.config import SimulationConfig
from sim.faults.injection import Failure, Unit
from sim.simulation import Simulation
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.module_errors import end_flight
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.msg.status import NavigationState
from uav_firmware.topology import Autopilot

ROUND_S: Final = 0.02
"""So much is flown at once: five control steps."""
STICKS_S: Final = 0.1
"""Period of the pilot's MANUAL_CONTROL."""
REACHED_M: Final = 3.0
"""Farther from a waypoint by truth it was not flown, whatever the flight stack reports."""
RETURN_M: Final = 10.0
"""Height of a return, below the fence of the plans."""
ON_CIRCLE_M: Final = 4.0
"""How far from its circle a vehicle may be while it turns."""
FLYING_M: Final = 0.3
OVERRIDDEN_S: Final = 2.0
"""A pilot who flies for so long in a mode of the autopilot flies no more: it was ordered."""
_BROKER: Final = "192.0.2.2", 14540
_PILOT: Final = "192.0.2.3", 14550
_PILOT_SYSTEM: Final = 255
_MODES: Final[Mapping[NavigationState, Mode]] = {
    NavigationState.MANUAL: Mode.PILOT,
    NavigationState.ALTCTL: Mode.PILOT,
    NavigationState.POSCTL: Mode.PILOT,
    NavigationState.AUTO_MISSION: Mode.MISSION,
    NavigationState.AUTO_RTL: Mode.RETURN,
    NavigationState.AUTO_LAND: Mode.LAND,
    NavigationState.ORBIT: Mode.ORBIT,
    NavigationState.AUTO_FOLLOW_TARGET: Mode.FOLLOW,
}
"""The others hold a place."""
_POSITION_MODE: Final = 3, 0
_LAND_MODE: Final = 4, 6
"""Main and sub mode of PX4."""


class _Link:
    """The vehicle's end of the network."""

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self.inbox: list[tuple[bytes, tuple[str, int]]] = []
        self._send = send

    def receive(self) -> Sequence[tuple[bytes, tuple[str, int]]]:
        """Give what has arrived."""
        inbox, self.inbox = self.inbox, []
        return inbox

    def send(self, datagram: bytes, address: tuple[str, int]) -> None:
        """Send to the broker; the pilot reads nothing."""
        if address == _BROKER:
            self._send(datagram)

    def refused_addresses(self) -> Sequence[tuple[str, int]]:
        """None: somebody listens everywhere."""
        return ()

    def close(self) -> None:
        """There is no socket."""


class FlightStack:
    """One vehicle with the whole flight stack; in the place of a `vehicle.Vehicle`."""

    def __init__(
        self, scheduler: Scheduler, system: int, send: Callable[[bytes], None], folder: Path
    ) -> None:
        """Stand at home; `send` takes each frame, `folder` keeps parameters and missions."""
        self.system = system
        self.truth = Truth()
        self.pilot_since_s: float | None = None
        self.booted_at_s = scheduler.now_s
        self.has_position = self.knows_battery = True
        self._scheduler = scheduler
        self._folder = folder
        self._send_frame = send
        self._link = _Link(self._sent)
        self._codec = mavlink.MAVLink(None, srcSystem=_PILOT_SYSTEM, srcComponent=190)
        self._reader = mavlink.MAVLink(None)
        self._items: dict[int, Any] = {}  # Of the mission, as they were received
        self._centres: dict[tuple[int, int], float] = {}  # Radius [m], by place [1e-7 deg]
        self._bearings: dict[tuple[int, int], float] = {}
        self._last_reached: int | None = None
        self._starts = 0
        self._next: Event | None = None
        self._sticks_s = 0.0
        self._switch_on()
        self.autopilot = replace(OWN, parameters=self.parameters)

    # What others see of it.

    @property
    def armed(self) -> bool:
        """Whether its motors may turn."""
        status = self._stack.topics.vehicle_status.value
        return self._next is not None and status is not None and status.armed

    @property
    def mode(self) -> Mode:
        """What it does, by itself."""
        status = self._stack.topics.vehicle_status.value
        return Mode.HOLD if status is None else _MODES.get(status.navigation_state, Mode.HOLD)

    @property
    def is_on(self) -> bool:
        """Whether it runs."""
        return self._next is not None

    @property
    def is_flying(self) -> bool:
        """Whether it is off the ground, by truth."""
        return self._next is not None and self.truth.height_m > FLYING_M

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters that a broker may borrow."""
        registry = self._stack.registry
        known = set(registry.names())
        return {name: float(registry.get(name)) for name in OWN.parameters if name in known}

    # Persons and faults.

    def take_over(self) -> None:
        """Have the pilot fly: position control, with centred sticks."""
        self.pilot_since_s = self._scheduler.now_s

    def release(self) -> None:
        """Have the pilot land it and give it back."""
        self.pilot_since_s = None
        self._order_mode(*_LAND_MODE)

    def fail(self, *, lands: bool) -> None:
        """Have it lose its position, or a motor."""
        unit, instance = (Unit.GPS, 0) if lands else (Unit.MOTOR, 1)
        self._scheduler.note(f"vehicle {self.system}", "-", f"loses {unit.name}")
        self._vehicle.inject(unit, Failure.OFF, instance)
        if unit is Unit.MOTOR and self.truth.height_m > REPORTED_FROM_M:
            self.truth.motor_failures_s.append(self._scheduler.now_s)

    def reboot(self) -> None:
        """Restart it: a new vehicle at home, with the stored mission and parameters."""
        self.switch_off()
        self._switch_on()

    def switch_off(self) -> None:
        """End it, and whatever it sends."""
        if self._next is not None:
            self._next.cancel()
        self._next = None
        self._simulation.close()
        self.pilot_since_s = None

    def switch_on(self) -> None:
        """Start it with a full battery."""
        self.reboot()

    def _switch_on(self) -> None:
        self._starts += 1
        self.booted_at_s = self._scheduler.now_s
        latitude_deg, longitude_deg, altitude_m = HOME
        seed = self._scheduler.random(f"flight/{self.system}/{self._starts}").randrange(2**31)
        self._simulation = Simulation(
            SimulationConfig(
                seed=seed,
                home_latitude_deg=latitude_deg,
                home_longitude_deg=longitude_deg,
                home_altitude_amsl_m=altitude_m,
                gps="rtk",
                imus=1,
                barometers=1,
                compasses=1,
            )
        )
        self._vehicle = JsbsimVehicle(self._simulation)
        start_s = EPOCH.timestamp() + self._scheduler.now_s
        self._stack = Autopilot(
            self._vehicle,
            self._link,
            FileStorage(self._folder),
            system_id=self.system,
            peers=(
                Peer(address=_BROKER, profile=Profile.ONBOARD),
                Peer(address=_PILOT, profile=Profile.GROUND_STATION),
            ),
            boot_time_utc_us=round(start_s * 1e6),
            world_us=lambda: round((EPOCH.timestamp() + self._scheduler.now_s) * 1e6),
            write_line=lambda _time_us, _text: None,
            on_error=end_flight,
        )
        self._stack.registry.set("RTL_RETURN_ALT", RETURN_M)
        self._link.inbox.clear()
        self._next = self._scheduler.after(ROUND_S, self._fly)

    # Time.

    def _fly(self) -> None:
        """Fly for a round, and note what it did."""
        self._next = self._scheduler.after(ROUND_S, self._fly)
        was_armed = self.armed
        for _ in range(round(ROUND_S * 1e6) // self._vehicle.step_us):
            self._stack.scheduler.step()
        if self._simulation.wrecked:
            self._scheduler.note(f"vehicle {self.system}", "-", "is wrecked and replaced")
            self.reboot()
            return
        if self.armed and not was_armed:
            self.truth.armings.append(Arming(self._scheduler.now_s))
        truth = self._simulation.truth
        self.truth.north_m, self.truth.east_m = offset_m(truth.latitude_deg, truth.longitude_deg)
        self.truth.height_m = truth.height_above_home_m
        self.truth.note_place()
        if self.is_flying:
            self.truth.flight_s += ROUND_S
            self._note_turns()
        if self.pilot_since_s is None:
            return
        if self._scheduler.now_s >= self._sticks_s:
            self._sticks_s = self._scheduler.now_s + STICKS_S
            self._move_sticks(self._scheduler.now_s - self.pilot_since_s)

    def _move_sticks(self, flown_s: float) -> None:
        """Have the pilot, who has flown for so long, hold the sticks, then take the mode."""
        self._order(mavlink.MAVLink_manual_control_message(self.system, 0, 0, 500, 0, 0))
        if self.mode is Mode.PILOT:
            return
        if flown_s > OVERRIDDEN_S:
            self.pilot_since_s = None
        elif flown_s > 2.0 * STICKS_S:
            self._order_mode(*_POSITION_MODE)

    def _note_turns(self) -> None:
        """Add to the angle that was flown round each centre."""
        for centre, radius_m in self._centres.items():
            north_m, east_m = offset_m(centre[0] / 1e7, centre[1] / 1e7)
            north_m, east_m = self.truth.north_m - north_m, self.truth.east_m - east_m
            bearing = math.atan2(east_m, north_m)
            before = self._bearings.get(centre, bearing)
            self._bearings[centre] = bearing
            if abs(math.hypot(north_m, east_m) - radius_m) < ON_CIRCLE_M:
                step = abs(math.remainder(bearing - before, math.tau))
                self.truth.turned_rad[centre] = self.truth.turned_rad.get(centre, 0.0) + step

    # The network.

    def receive(self, datagram: bytes) -> None:
        """Take a datagram of the broker; lost while the vehicle is off."""
        if self._next is None:
            return
        self._link.inbox.append((datagram, _BROKER))
        self._stack.serve_link()
        try:
            message = self._reader.decode(bytearray(datagram))
        except (mavlink.MAVError, IndexError):
            return
        if getattr(message, "target_system", self.system) in {0, self.system}:
            self._note_received(message)

    def _note_received(self, message: Any) -> None:
        """Note orders under a pilot, and the places that a mission or an order leads to."""
        match message.get_type():
            case "MISSION_ITEM_INT" if message.mission_type == mavlink.MAV_MISSION_TYPE_MISSION:
                self._items[message.seq] = message
                if message.command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
                    self._centres[message.x, message.y] = abs(message.param3)
            case "COMMAND_INT" | "COMMAND_LONG":
                self._last_reached = None
                if message.command == mavlink.MAV_CMD_DO_ORBIT:
                    self._centres[message.x, message.y] = abs(message.param1)
                if message.command in ORDERS:
                    self._note_order(mavlink.enums["MAV_CMD"][message.command].name)
            case "MISSION_COUNT" | "MISSION_SET_CURRENT":
                self._last_reached = None
                if message.get_type() == "MISSION_COUNT":
                    self._note_order("MISSION_COUNT")

    def _note_order(self, name: str) -> None:
        if self.pilot_since_s is not None and self.armed:
            order = OrderUnderPilot(self._scheduler.now_s, self.pilot_since_s, name)
            self.truth.orders_under_pilot.append(order)

    def _sent(self, datagram: bytes) -> None:
        """Send a frame to the broker, and note the waypoints that were reached by truth."""
        self._send_frame(datagram)
        is_frame = len(datagram) > 9 and datagram[0] == mavlink.PROTOCOL_MARKER_V2
        kind = int.from_bytes(datagram[7:10], "little") if is_frame else -1
        if kind == mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED:
            self._note_reached(self._reader.decode(bytearray(datagram)).seq)

    def _note_reached(self, seq: int) -> None:
        item = self._items.get(seq)
        if seq == self._last_reached:
            return  # The flight stack repeats it
        self._last_reached = seq
        if item is None or item.command != mavlink.MAV_CMD_NAV_WAYPOINT:
            return
        north_m, east_m = offset_m(item.x / 1e7, item.y / 1e7)
        away_m = math.hypot(self.truth.north_m - north_m, self.truth.east_m - east_m)
        if away_m < REACHED_M:
            self.truth.reached.append(Reached(self._scheduler.now_s, item.x, item.y))

    def _order_mode(self, main: int, sub: int) -> None:
        self._order(
            mavlink.MAVLink_command_long_message(
                self.system, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1.0, main, sub, 0, 0, 0, 0
            )
        )

    def _order(self, message: Any) -> None:
        """Have the pilot's own radio send a message."""
        self._link.inbox.append((bytes(message.pack(self._codec)), _PILOT))
        self._stack.serve_link()
