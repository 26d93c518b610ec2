"""The vehicle on the link: MAVSDK's server plugins, and nothing of this project's MAVLink.

MAVSDK's threads call back; everything that they bring goes through `on_event`, which must be safe
to call from any thread. The only file that imports mavsdk.
"""

import json
import math
import time
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.connection_result import ConnectionResult
from mavsdk.logging import log_subscribe
from mavsdk.plugins.action_server.action_server import ActionServer, AllowableFlightModes
from mavsdk.plugins.mavlink_direct_server.mavlink_direct_server import (
    MavlinkDirectServer,
    MavlinkMessage,
)
from mavsdk.plugins.mission_raw_server.mission_raw_server import MissionRawServer
from mavsdk.plugins.param_server.param_server import ParamServer
from mavsdk.plugins.telemetry_server.telemetry_server import (
    Battery,
    LandedState,
    StatusText,
    StatusTextType,
    TelemetryServer,
    VtolState,
)

from sim.tester.vehicle import telemetry
from sim.tester.vehicle.alarms import Alarm
from sim.tester.vehicle.command_results import CAMERA, MAVSDKS
from sim.tester.vehicle.events import (
    Acknowledge,
    AreaReceived,
    Armed,
    Command,
    CompleteItems,
    ItemMadeCurrent,
    LinkEvent,
    MeasureHumidity,
    MissionCleared,
    MissionReceived,
    Observe,
    Order,
    Publish,
    ShowArming,
    Warn,
)
from sim.tester.vehicle.mission import MissionState
from sim.tester.vehicle.mission_steps import Item
from sim.tester.vehicle.stand_in import StandIn
from sim.tester.vehicle.telemetry import VehicleMessage


def place_reports(vehicle: StandIn, now: float) -> tuple[VehicleMessage, ...]:
    """Attitude, then place."""
    time_ms = vehicle.time_ms(now)
    return (
        telemetry.attitude(vehicle.pose, time_ms),
        telemetry.position(vehicle.pose, vehicle.home, time_ms),
    )


def regular_reports(vehicle: StandIn, now: float, utc_s: float) -> tuple[VehicleMessage, ...]:
    """All that is sent regularly, but for what MAVSDK's own plugins send."""
    mission = vehicle.mission
    return (
        telemetry.system_time(utc_s, vehicle.time_ms(now)),
        telemetry.home_position(vehicle.home),
        *place_reports(vehicle, now),
        telemetry.system_status(vehicle.ill, vehicle.percentage),
        telemetry.mission_current(
            mission.current,
            len(mission.items),
            mission.state,
            in_mission=mission.state is MissionState.ACTIVE,
        ),
    )


def observation(vehicle: StandIn) -> VehicleMessage:
    """What is observed wherever a command is finished."""
    seen = vehicle.observation
    return telemetry.observation(
        seen.resource_id, seen.observed_property, seen.result_value, seen.result_uom
    )


CAPACITY_PARAMETER: Final = "BAT1_CAPACITY"
_AREAS: Final[Mapping[int, str]] = {1: "geofence", 2: "rally points"}
_OF_MISSIONS: Final = frozenset({0, 255})
"""MAV_MISSION_TYPE of a mission, and of everything."""
_VOLTAGE_V: Final = 12.0
_UNKNOWN_PROGRESS: Final = 255
_HALF_A_PERCENT: Final = 0.005
"""The plugin cuts where it should round."""


class LinkError(Exception):
    """MAVSDK cannot open the link; the message says which."""


class _Component:
    """One MAVLink component with a link of its own, which ends when it is switched off."""

    def __init__(self, kind: ComponentType, system_id: int, url: str) -> None:
        configuration = Configuration.create_with_component_type(kind)
        configuration.system_id = system_id
        self._mavsdk = Mavsdk(configuration)
        result = self._mavsdk.add_any_connection(url)
        if result != ConnectionResult.SUCCESS:
            self._mavsdk.destroy()
            raise LinkError(f"{url}: {result.name.lower().replace('_', ' ')}")
        self.server = self._mavsdk.server_component_by_type(kind)
        self.direct = MavlinkDirectServer(self.server)

    def send(self, message: VehicleMessage, to: tuple[int, int] = (0, 0)) -> None:
        """Send a message as it is."""
        fields = json.dumps(dict(message.fields))
        self.direct.send_message(MavlinkMessage(message.name, 0, 0, *to, fields))

    def subscribe(self, on_message: Callable[[Any], None]) -> None:
        """Pass received commands on."""
        for name in ("COMMAND_LONG", "COMMAND_INT"):
            self.direct.subscribe_message(name, lambda message, _: on_message(message))

    def close(self) -> None:
        """Fall silent."""
        self._mavsdk.destroy()


class MavsdkVehicle:
    """An autopilot and its camera."""

    def __init__(self, system_id: int, url: str, on_event: Callable[[LinkEvent], None]) -> None:
        _keep_quiet()
        self._system_id = system_id
        self._url = url
        self._on_event = on_event
        self._autopilot = _Component(ComponentType.AUTOPILOT, system_id, url)
        self._camera: _Component | None = None
        server = self._autopilot.server
        self._parameters = ParamServer(server)
        self._telemetry = TelemetryServer(server)
        self._action = ActionServer(server)
        self._mission = MissionRawServer(server)
        self._capacity_mah = math.nan
        self._listen()

    def _listen(self) -> None:
        self._action.set_armable(armable=True, force_armable=True)
        self._action.set_disarmable(disarmable=True, force_disarmable=True)
        self._action.set_allow_takeoff(allow_takeoff=True)
        modes = AllowableFlightModes(can_auto_mode=True, can_guided_mode=True)
        self._action.set_allowable_flight_modes(modes)
        notify = self._on_event
        self._action.subscribe_arm_disarm(lambda _result, order, _: notify(Armed(order.arm)))
        self._mission.subscribe_incoming_mission(
            lambda _result, plan, _: notify(_received(plan.mission_items))
        )
        self._mission.subscribe_current_item_changed(
            lambda item, _: notify(ItemMadeCurrent(item.seq))
        )
        self._mission.subscribe_clear_all(self._cleared)
        self._autopilot.subscribe(self._on_command)

    def _cleared(self, kind: int, _: object) -> None:
        if kind in _OF_MISSIONS:
            self._on_event(MissionCleared())

    def _on_command(self, message: Any) -> None:
        fields = json.loads(message.fields_json)
        is_ours = fields["target_system"] in {0, self._system_id}
        if is_ours and fields["command"] not in MAVSDKS:
            self._on_event(_command(message, fields))

    def publish(self, vehicle: StandIn, now: float) -> None:
        """Send what a vehicle sends all the time."""
        self._power_camera(on=Alarm.CAMERA not in vehicle.alarms)
        if vehicle.capacity_mah != self._capacity_mah:
            self._capacity_mah = vehicle.capacity_mah
            self._parameters.provide_param_float(CAPACITY_PARAMETER, vehicle.capacity_mah)
        landed = LandedState.ON_GROUND if vehicle.is_down else LandedState.IN_AIR
        self._telemetry.publish_extended_sys_state(VtolState.UNDEFINED, landed)
        left = vehicle.percentage / 100.0 + _HALF_A_PERCENT
        self._telemetry.publish_battery(Battery(voltage_v=_VOLTAGE_V, remaining_percent=left))
        for message in regular_reports(vehicle, now, time.time()):
            self._autopilot.send(message)

    def carry_out(self, order: Order, vehicle: StandIn, now: float) -> None:
        """Do on the link what the vehicle does; what is for the person is passed over."""
        match order:
            case Acknowledge(command, result):
                self._acknowledge(command, result.value)
            case CompleteItems(count):
                for _ in range(count):
                    self._mission.set_current_item_complete()
            case ShowArming(armed):
                self._action.set_armed_state(is_armed=armed)
                self._autopilot.send(telemetry.heartbeat(armed=armed))
                self.publish(vehicle, now)
            case Publish(pose):
                time_ms = vehicle.time_ms(now)
                self._autopilot.send(telemetry.attitude(pose, time_ms))
                self._autopilot.send(telemetry.position(pose, vehicle.home, time_ms))
            case Observe():
                # The broker reports a command when the mission is beyond it; the rest comes before.
                self._autopilot.send(observation(vehicle))
                self.publish(vehicle, now)
            case MeasureHumidity(percent):
                self._autopilot.send(telemetry.humidity(percent, vehicle.time_ms(now)))
            case Warn(text, parameters):
                self._autopilot.send(telemetry.alarm_parameters(parameters))
                self._telemetry.publish_status_text(StatusText(StatusTextType.CRITICAL, text))

    def close(self) -> None:
        """Fall silent."""
        self._power_camera(on=False)
        self._autopilot.close()

    def _acknowledge(self, command: Command, result: int) -> None:
        system, component = command.sender
        fields = {
            "command": command.number,
            "result": result,
            "progress": _UNKNOWN_PROGRESS,
            "result_param2": 0,
            "target_system": system,
            "target_component": component,
        }
        if command.component == CAMERA and self._camera is not None:
            self._camera.send(VehicleMessage("COMMAND_ACK", fields), command.sender)
        else:
            self._autopilot.send(VehicleMessage("COMMAND_ACK", fields), command.sender)

    def _power_camera(self, *, on: bool) -> None:
        """Switch the camera; its heartbeat comes and goes with it.

        Commands for it come over its own link or the autopilot's, as the broker pleases.
        """
        if on and self._camera is None:
            self._camera = _Component(ComponentType.CAMERA, self._system_id, self._url)
            self._camera.subscribe(self._on_command)
        elif not on and self._camera is not None:
            self._camera.close()
            self._camera = None


@cache
def _keep_quiet() -> None:
    """Drop MAVSDK's own log, which would stand between the menus; once, it is the process's."""
    log_subscribe(lambda *_: True)


def _received(held: list[Any]) -> MissionReceived | AreaReceived:
    """Distinguish missions from fences and rally points, which MAVSDK does not."""
    what = _AREAS.get(held[0].mission_type) if held else None
    return MissionReceived(_items(held)) if what is None else AreaReceived(what, len(held))


def _items(held: list[Any]) -> tuple[Item, ...]:
    return tuple(
        Item(
            command=item.command,
            param1=item.param1,
            param2=item.param2,
            param3=item.param3,
            param4=item.param4,
            x=item.x,
            y=item.y,
            z=item.z,
        )
        for item in held
    )


def _command(message: Any, fields: dict[str, Any]) -> Command:
    is_int = message.message_name == "COMMAND_INT"
    names = ("x", "y", "z") if is_int else ("param5", "param6", "param7")
    values = [fields[name] for name in (*(f"param{n}" for n in range(1, 5)), *names)]
    one, two, three, four, five, six, seven = (math.nan if v is None else float(v) for v in values)
    return Command(
        number=fields["command"],
        parameters=(one, two, three, four, five, six, seven),
        frame=fields.get("frame", 0),
        component=fields["target_component"],
        sender=(message.system_id, message.component_id),
    )
