"""The faults of a world, and which of them a seed enables.

Each seed enables a random subset (A. Groce and others, "Swarm Testing", ISSTA 2012): a world with
every fault at once hides what two of them do together.
"""

from enum import StrEnum
from random import Random
from typing import Final


class Fault(StrEnum):
    """What goes wrong."""

    LOSS = "loss"
    DUPLICATION = "duplication"
    REORDERING = "reordering"
    CORRUPTION = "corruption"
    LINK_DOWN = "link-down"
    LINK_SLOW = "link-slow"
    LINK_CUT_AT_CHANGES = "link-cut-at-changes"
    EDGE_REQUESTS_LOST = "edge-requests-lost"
    EDGE_ANSWERS_LOST = "edge-answers-lost"
    EDGE_ANSWERS_STALLED = "edge-answers-stalled"
    EDGE_ANSWERS_FOREIGN = "edge-answers-foreign"
    REPORT_ALWAYS_FAILS = "report-always-fails"
    EDGE_UNREACHABLE = "edge-unreachable"
    CLOUD_UNREACHABLE = "cloud-unreachable"
    CLOUD_ANSWERS_LOST = "cloud-answers-lost"
    BROKER_KILLED = "broker-killed"
    BROKER_SUSPENDED = "broker-suspended"
    EDGE_KILLED = "edge-killed"
    RELAY_KILLED = "relay-killed"
    KILLED_AT_CHANGES = "killed-at-changes"
    VEHICLE_REBOOTED = "vehicle-rebooted"
    VEHICLE_FAILS = "vehicle-fails"
    SWAPPED = "swapped"
    TWICE = "twice"
    REBOOTED_IN_FLIGHT = "rebooted-in-flight"
    NOT_A_NUMBER = "not-a-number"
    POSITION_UNKNOWN = "position-unknown"
    BATTERY_UNKNOWN = "battery-unknown"
    POWER_CUT = "power-cut"
    POWER_LOST = "power-lost"
    CLOCKS = "clocks"
    DISK_FULL = "disk-full"
    DISK_READ_ONLY = "disk-read-only"
    DISK_SLOW = "disk-slow"
    DATABASE_LOCKED = "database-locked"
    PILOT = "pilot"
    REPEATED_MISSIONS = "repeated-missions"
    REPEATED_POSTS = "repeated-posts"
    CANCELLATIONS = "cancellations"
    EXPIRIES = "expiries"
    ABORTS = "aborts"
    PAUSES = "pauses"
    LONG_MISSIONS = "long-missions"
    GEOFENCES = "geofences"
    PICTURES = "pictures"


KINEMATIC_ONLY: Final = frozenset(
    {
        *(Fault.NOT_A_NUMBER, Fault.POSITION_UNKNOWN, Fault.BATTERY_UNKNOWN),
        *(Fault.SWAPPED, Fault.TWICE, Fault.PICTURES),
    }
)
"""What the flight stack does not do on demand."""


PLACES: Final = (
    (
        *(Fault.LOSS, Fault.DUPLICATION, Fault.REORDERING, Fault.CORRUPTION),
        *(Fault.LINK_DOWN, Fault.LINK_SLOW, Fault.LINK_CUT_AT_CHANGES),
    ),
    (
        *(Fault.EDGE_REQUESTS_LOST, Fault.EDGE_ANSWERS_LOST, Fault.EDGE_ANSWERS_STALLED),
        *(Fault.EDGE_ANSWERS_FOREIGN, Fault.EDGE_UNREACHABLE, Fault.REPORT_ALWAYS_FAILS),
    ),
    (Fault.CLOUD_UNREACHABLE, Fault.CLOUD_ANSWERS_LOST, Fault.RELAY_KILLED),
    (
        *(Fault.BROKER_KILLED, Fault.BROKER_SUSPENDED, Fault.EDGE_KILLED, Fault.KILLED_AT_CHANGES),
        *(Fault.POWER_CUT, Fault.POWER_LOST, Fault.CLOCKS),
    ),
    (Fault.DISK_FULL, Fault.DISK_READ_ONLY, Fault.DISK_SLOW, Fault.DATABASE_LOCKED),
)
"""Where a seed may have no faults at all: one that works lets those of other places meet."""
INTACT_SHARE: Final = 1.0 / 3.0


def draw(seed: int) -> frozenset[Fault]:
    """Give the faults that a seed enables: a share of those of each place that is not intact."""
    random = Random(f"{seed}/swarm")
    share = random.uniform(0.1, 0.7)
    intact = {fault for place in PLACES if random.random() < INTACT_SHARE for fault in place}
    return frozenset(
        fault
        for fault in Fault
        if Random(f"{seed}/swarm/{fault}").random() < share and fault not in intact
    )
