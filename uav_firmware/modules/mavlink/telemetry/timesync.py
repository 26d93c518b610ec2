"""Clocks: answers to TIMESYNC and PING, both in vehicle time.

SYSTEM_TIME from a ground station needs no answer: the vehicle's clock is its own, and a
simulation's runs at its own speed.
"""

from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink


def answer_timesync(message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
    """Answer a request (tc1 is 0) with own time [ns]; the answer to a request needs none."""
    if message.tc1 != 0:
        return []
    answer = mavlink.MAVLink_timesync_message(tc1=now_us * 1000, ts1=message.ts1)
    return [Outgoing(answer, sender.address)]


def answer_ping(message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
    """Answer a request (target 0/0) by sending it back; a PING with a target is an answer."""
    if (message.target_system, message.target_component) != (0, 0):
        return []
    answer = mavlink.MAVLink_ping_message(
        time_usec=message.time_usec,
        seq=message.seq,
        target_system=sender.system,
        target_component=sender.component,
    )
    return [Outgoing(answer, sender.address)]
