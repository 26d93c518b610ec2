"""A scripted vehicle that also stores a geofence, rally points and parameters.

Geofence and rally points are stored separately from the mission. Integers among the parameters
travel as their values (C cast), as ArduPilot sends them; PX4's that matter here are floats.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from tests.support.broker_world import World
from tests.support.scripted_missions import ScriptedMissions
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import ARDUPILOT, PX4, Script
from tests.support.vehicle_wire import Message, mavlink

FENCE, RALLY = 1, 2
ABLE = mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
PX4_VALUES = {"GF_MAX_VER_DIST": 0.0, "RTL_RETURN_ALT": 60.0, "BAT1_CAPACITY": 4200.0}
ARDUPILOT_VALUES = {
    "MIS_RESTART": 0,
    "FENCE_ENABLE": 0,
    "FENCE_AUTOENABLE": 0,
    "FENCE_TYPE": 7,
    "FENCE_ALT_MAX": 100.0,
    "FENCE_OPTIONS": 1,
    "BATT_CAPACITY": 4200,
}
"""As an ArduCopter leaves the factory; an int is an integer parameter."""


class FencedVehicle(ScriptedVehicle):
    """A scripted vehicle with geofence, rally points and parameters."""

    def __init__(
        self,
        system: int,
        script: Script,
        *,
        booted_at: float,
        capabilities: int = ABLE,
        values: Mapping[str, float] | None = None,
        types_items: bool = True,
    ) -> None:
        """`types_items`: an item says of what kind its plan is; PX4 up to 1.14.0 sends 0."""
        super().__init__(system, script, booted_at=booted_at)
        self._types_items = types_items
        of_family = {PX4.autopilot: PX4_VALUES, ARDUPILOT.autopilot: ARDUPILOT_VALUES}
        self.capabilities = capabilities
        self.uid = 0  # Of its hardware; 0: not sent
        self.values = dict(of_family.get(script.autopilot, {}) if values is None else values)
        self.set: list[tuple[str, float]] = []  # Parameters written, in order
        self.asked: set[str] = set()  # Parameters that were read
        self.refused_values: set[str] = set()
        self.plans = {kind: self._store(kind, script) for kind in (FENCE, RALLY)}
        self._switches = self._switch_values
        self._enforced = int(self.values.get("FENCE_TYPE", 0)) if self._switches[0] else 0
        self._looks_at = 0.0
        self._was_armed = self._was_airborne = False
        self.log: list[str] = []  # What was stored or removed, and armed, in order

    @property
    def fence(self) -> list[tuple[int, float, float]]:
        """The stored fence: command, latitude and longitude of each item."""
        return [(item.command, item.x / 1e7, item.y / 1e7) for item in self.plans[FENCE].items]

    @property
    def enforced_types(self) -> int:
        """Which fences ArduPilot since 4.6 keeps, as bits of FENCE_TYPE (`AC_Fence.cpp`).

        Those that were configured when FENCE_ENABLE or FENCE_AUTOENABLE changed last, or when the
        latter enabled them, and still are.
        """
        return self._enforced & int(self.values["FENCE_TYPE"])

    @property
    def _switch_values(self) -> tuple[bool, int]:
        values = self.values
        when = values.get("FENCE_AUTOENABLE", 0.0)
        return bool(values.get("FENCE_ENABLE", 0)), int(when) if math.isfinite(when) else 0

    def _look_at_switch(self, now: float) -> None:
        """Notice a change of the parameters, ten times a second."""
        if now < self._looks_at or "FENCE_ENABLE" not in self.values:
            return
        self._looks_at = now + 0.1
        if self._switch_values != self._switches:
            self._switches = self._switch_values
            self._enforced = int(self.values["FENCE_TYPE"]) if self._switches[0] else 0

    def _enable_by_itself(self) -> None:
        """Do what FENCE_AUTOENABLE orders: behind a take-off (1, 2), or while it is armed (3)."""
        automatic = self._switch_values[1]
        if automatic == 3 and self.armed != self._was_armed:
            self._enforced = int(self.values["FENCE_TYPE"]) if self.armed else 0
        if automatic in {1, 2} and self.airborne and not self._was_airborne:
            self._enforced = int(self.values["FENCE_TYPE"])
        if automatic == 1 and self._was_airborne and not self.airborne:
            self._enforced = 0
        self._was_armed, self._was_airborne = self.armed, self.airborne

    def receive(self, datagram: bytes, now: float) -> None:
        """Process a datagram of the broker."""
        self._now = now
        for message in self._wire.decode(datagram):
            if getattr(message, "target_system", self.system) not in {0, self.system}:
                continue
            store = self.plans.get(getattr(message, "mission_type", 0), self.missions)
            if message.get_type() == "MISSION_CLEAR_ALL":
                self._clear(message.mission_type)
            else:
                store.handle(message, now)
            self._handle(message)

    def send_version(self) -> None:
        """Send AUTOPILOT_VERSION without a request."""
        self.send(self._autopilot_version())

    def step(self, now: float) -> list[bytes]:
        """Advance to a time; returns the frames to send."""
        for store in self.plans.values():
            store.tick(now)
        self._look_at_switch(now)
        was_armed = self.armed
        frames = super().step(now)
        self._enable_by_itself()
        if self.armed and not was_armed:
            self.log.append("armed")
        return frames

    def _store(self, kind: int, script: Script) -> ScriptedMissions:
        def send(message: Message) -> None:
            is_item = message.get_type() == "MISSION_ITEM_INT"
            message.mission_type = kind if self._types_items or not is_item else 0
            self._send(message)

        plain = Script(
            gives_ids=script.gives_ids,
            float_requests=script.float_requests,
            lost_acknowledgements=script.lost_acknowledgements,
        )
        if kind == RALLY and script.autopilot == ARDUPILOT.autopilot:
            plain = replace(plain, keeps=_whole_metres)
        return ScriptedMissions(plain, send, lambda: self.log.append(f"stored {kind}"))

    def _mission_stored(self) -> None:
        self.log.append("stored 0")
        super()._mission_stored()

    def _clear(self, kind: int) -> None:
        if self.plans[kind].is_busy():
            return
        self.plans[kind].items = []
        self.log.append(f"cleared {kind}")
        self._send(mavlink.MAVLink_mission_ack_message(0, 0, mavlink.MAV_MISSION_ACCEPTED, kind))

    def _mission_current(self) -> Message:
        message = super()._mission_current()
        message.fence_id = self.plans[FENCE].plan_id
        message.rally_points_id = self.plans[RALLY].plan_id
        return message

    def _autopilot_version(self) -> Message:
        message = super()._autopilot_version()
        message.capabilities = self.capabilities
        message.uid = self.uid
        return message

    def _handle(self, message: Message) -> None:
        if message.get_type() == "PARAM_SET":
            self._set(message.param_id, message.param_value)
        elif message.get_type() == "COMMAND_LONG" and message.command == 400:
            self.log.append("ordered to arm")
        super()._handle(message)

    def _parameter(self, message: Message) -> None:
        self.asked.add(message.param_id)
        if message.param_id in self.values:
            self._send_value(message.param_id)

    def _set(self, name: str, value: float) -> None:
        if name in self.values and name not in self.refused_values:
            kind = type(self.values[name])
            self.set.append((name, value))
            self.values[name] = kind(value)
        self._send_value(name)

    def _send_value(self, name: str) -> None:
        is_integer = isinstance(self.values[name], int)
        kind = mavlink.MAV_PARAM_TYPE_INT16 if is_integer else mavlink.MAV_PARAM_TYPE_REAL32
        value = float(self.values[name])
        self._send(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 0))


def _whole_metres(item: Message) -> Message:
    """Keep a rally point as ArduPilot does, its altitude in an integer."""
    item.z = float(int(item.z))
    return item


def fenced_vehicle(
    world: World,
    script: Script = PX4,
    *,
    capabilities: int = ABLE,
    values: Mapping[str, float] | None = None,
    types_items: bool = True,
) -> FencedVehicle:
    """Add such a vehicle to a world."""
    vehicle = FencedVehicle(
        1,
        script,
        booted_at=world.clock.now,
        capabilities=capabilities,
        values=values,
        types_items=types_items,
    )
    world.air.vehicles["192.0.2.1", 14581] = vehicle
    return vehicle


GENERIC = replace(PX4, autopilot=mavlink.MAV_AUTOPILOT_GENERIC, gives_ids=False)
