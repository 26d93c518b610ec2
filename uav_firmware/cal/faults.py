"""Breaking parts on purpose, where the vehicle can: a simulation, a bench."""

from typing import Protocol, runtime_checkable


@runtime_checkable
class FaultInjector(Protocol):
    """A vehicle whose parts can be made to fail; a driver may implement it beside `Vehicle`.

    The numbers are MAVLink's: FAILURE_UNIT, FAILURE_TYPE (0 mends the unit) and the instance,
    counted from 1; instance 0 means all of them.
    """

    @property
    def link_lost(self) -> bool:
        """Whether a fault cuts the vehicle off from its peers now."""

    def inject(self, unit: int, failure_type: int, instance: int) -> bool:
        """Let a part fail, or mend it; false if there is no such part or no such failure."""
