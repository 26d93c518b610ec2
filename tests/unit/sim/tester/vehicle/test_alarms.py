"""Each alarm that a person sets is exactly that alarm at the broker, in simulated time."""

import math

import pytest

from afarcloud.enumerations import AlarmCode
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.vehicle.alarms import AlarmMonitor
from sim.tester.terminal.operator import PUBLISH_EVERY_S, Operator
from sim.tester.vehicle import telemetry
from sim.tester.vehicle.actions import SetAlarm
from sim.tester.vehicle.alarms import PRESENT, Alarm
from sim.tester.vehicle.events import MeasureHumidity, Order
from sim.tester.vehicle.mavsdk_link import regular_reports
from sim.tester.vehicle.stand_in import ORDER_WITHIN_S, StandIn
from sim.tester.vehicle.telemetry import Home, VehicleMessage

CODES = {
    Alarm.SONAR: AlarmCode.EQUIPMENT_SONAR,
    Alarm.PROPELLERS: AlarmCode.EQUIPMENT_PROPELLERS,
    Alarm.IMU: AlarmCode.EQUIPMENT_IMU,
    Alarm.CAMERA: AlarmCode.EQUIPMENT_CAMERA,
    Alarm.GPS: AlarmCode.EQUIPMENT_GPS,
    Alarm.HUMIDITY_SENSOR: AlarmCode.EQUIPMENT_HUMIDITY_SENSOR,
    Alarm.LOCALIZATION: AlarmCode.FUNCTION_LOCALISATION,
    Alarm.PROPULSION: AlarmCode.FUNCTION_PROPULSION,
    Alarm.NAVIGATION: AlarmCode.FUNCTION_NAVIGATION,
    Alarm.HUMIDITY_SENSING: AlarmCode.FUNCTION_HUMIDITY_SENSING,
}


class Ear:
    """A link that ends at the broker's watch, with a camera whose heartbeat comes by it."""

    def __init__(self) -> None:
        self.watch = AlarmMonitor()
        self._encoder, self._decoder = Encoder(1, 1), Decoder()
        self._camera_at = -math.inf

    def publish(self, vehicle: StandIn, now: float) -> None:
        for words in regular_reports(vehicle, now, 1.8e9):
            self._say(words, now)
        if Alarm.CAMERA not in vehicle.alarms and now >= self._camera_at:
            self._camera_at = now + 1.0
            self.watch.camera_received(now)

    def carry_out(self, order: Order, vehicle: StandIn, now: float) -> None:
        if isinstance(order, MeasureHumidity):
            self._say(telemetry.humidity(order.percent, vehicle.time_ms(now)), now)

    def _say(self, words: VehicleMessage, now: float) -> None:
        kind = getattr(mavlink, f"MAVLink_{words.name.lower()}_message")
        fields = dict(words.fields)
        if "name" in fields:
            fields["name"] = fields["name"].encode()
        if words.name == "SYS_STATUS":
            fields |= dict.fromkeys(kind.fieldnames[7:13], 0)
        self.watch.receive(self._carried(kind(**fields)), now)

    def _carried(self, message: Message) -> Message:
        (received,) = self._decoder.decode(self._encoder.encode(message))
        return received


@pytest.mark.parametrize("alarm", Alarm)
def test_an_alarm_is_exactly_that_alarm_before_the_vehicle_lands_by_itself(alarm: Alarm) -> None:
    ear = Ear()
    vehicle = StandIn(Home(40.4434, -3.7382, 650.0), 0.0)
    operator = Operator(vehicle, ear, lambda low, _high: low, lambda _text: None)
    reported: list[AlarmCode] = []
    for step in range(round((10.0 + ORDER_WITHIN_S) / PUBLISH_EVERY_S)):
        now = step * PUBLISH_EVERY_S
        if now == 10.0:
            assert reported == []
            vehicle.act(SetAlarm(alarm, (0.5, 1.5)), now)
        operator.tick(now)
        reported += [failure.code for failure in ear.watch.tick(now, is_connected=True)]
    assert reported == [CODES[alarm]]


def test_what_is_ill_is_there() -> None:
    for alarm in Alarm:
        assert alarm.ill & ~PRESENT == 0
