"""Reads the state of the farm from the database."""

import logging
import time
from collections.abc import Callable
from typing import Any, Final

from afarcloud.enumerations import Status
from edge_server import relay_health
from edge_server.live.farm import Farm, Row
from edge_server.outbox import counts
from edge_server.services import flight_archive
from edge_server.services.context import Context
from edge_server.services.errors import UnavailableError
from edge_server.services.fleet import events as event_service
from edge_server.services.fleet import vehicles
from edge_server.store.rows import events, work

LOG = logging.getLogger(__name__)
RECENT_S: Final = 600.0
"""Missions and events stay in the complete state so long after their end, alarms after their
acknowledgement."""
MOST_ROWS: Final = 200
UPLINK_PERIOD_S: Final = 5.0
"""Counting the records that wait takes longer the more there are."""


def reader(context: Context) -> Callable[[], Farm]:
    """Make the function that reads the state of the farm."""
    uplink: Row = {}
    uplink_at = float("-inf")
    alarms: dict[int, Row] = {}

    def read() -> Farm:
        nonlocal uplink, uplink_at, alarms
        if time.monotonic() >= uplink_at:
            uplink, uplink_at = _uplink(context), time.monotonic() + UPLINK_PERIOD_S
        since = context.clock() - RECENT_S
        with context.database.read() as connection:
            stored = events.page(
                connection, after_id=0, limit=MOST_ROWS, since_s=since, vehicle_id=None
            )
            missions = [
                _mission(item, work.commands(connection, item.id))
                for item in work.recent_missions(connection, ended_since=since, limit=MOST_ROWS)
            ]
        try:
            present = flight_archive.present_alarms(context, since, MOST_ROWS)
            alarms = {row["id"]: row for row in present}
        except UnavailableError as error:
            LOG.warning("the live stream shows no new alarms: %s", error)
        return Farm(
            vehicles={row["vehicle_id"]: row for row in vehicles.everyone(context)},
            missions={row["id"]: row for row in missions},
            events={one.id: event_service.show(one) for one in stored},
            alarms=alarms,
            uplink=uplink,
        )

    return read


def _mission(item: work.Work, progress: dict[int, work.CommandProgress]) -> dict[str, Any]:
    body = item.body or {}
    return {
        "id": item.id,
        "plan_id": item.plan_id,
        "mission_id": item.mission_id,
        "vehicle_id": item.vehicle_id,
        "dispatch_state": item.state,
        "mission_status_id": item.status_id or int(Status.NOT_STARTED),
        "message": item.message,
        "command_array": [
            {
                "command_id": one["command_id"],
                "command_type_id": one["command_type_id"],
                "command_status_id": progress[one["command_id"]].status_id,
            }
            for one in body.get("command_array", [])
        ],
    }


def _uplink(context: Context) -> Row:
    relay = relay_health.read(context.config)
    with context.database.read() as connection:
        waiting = counts.count_waiting(connection)
    return {
        "state": relay.uplink.name.lower(),
        "records_waiting": sum(waiting.queued.values()),
        "dead_letters": sum(waiting.dead.values()),
    }
