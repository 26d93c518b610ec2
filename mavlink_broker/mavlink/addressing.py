"""From whom to whom: the addresses that every directed message carries."""

from typing import NamedTuple

from mavlink_broker.mavlink.dialect import Message


class Route(NamedTuple):
    """Our own address and that of one vehicle's autopilot."""

    own_system: int
    own_component: int
    target_system: int
    target_component: int

    def is_for_us(self, message: Message) -> bool:
        """Whether a directed message means us; 0 means everybody, and so do senders without it."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in {0, self.own_system} and component in {0, self.own_component}
