"""Failure injection, for a simulation or a test bench."""

from typing import Protocol, runtime_checkable


@runtime_checkable
class FaultInjector(Protocol):
    """A vehicle whose parts can be made to fail; a driver may implement it beside `Vehicle`.

    The numbers are MAVLink's: FAILURE_UNIT, FAILURE_TYPE (0 clears the failure) and the instance,
    counted from 1; instance 0 means all of them.
    """

    @property
    def link_lost(self) -> bool:
        """Whether a fault interrupts the link to the peers now."""

    def inject(self, unit: int, failure_type: int, instance: int) -> bool:
        """Inject or clear a failure; False for an unknown unit or failure."""
