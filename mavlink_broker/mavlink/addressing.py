"""Source and target ids of directed messages."""

from typing import NamedTuple

from mavlink_broker.mavlink.dialect import Message


class Route(NamedTuple):
    """The broker's own ids and those of one vehicle's autopilot."""

    own_system: int
    own_component: int
    target_system: int
    target_component: int

    def is_for_us(self, message: Message) -> bool:
        """Whether a message addresses the broker; 0 or a missing field addresses everybody."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in {0, self.own_system} and component in {0, self.own_component}
