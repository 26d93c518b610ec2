"""What must hold of links: the operator knows whether a vehicle that is received can be ordered."""

from collections import defaultdict
from typing import Final

from dst.world.world import World

SHOWN_S: Final = 20.0
"""After a change of the link, of the broker or of the vehicle, what is shown is right."""
MOST_LOSS: Final = 0.3
"""With more frames lost a healthy link may look like a dead one."""


class LinkLaws:
    """Watches the links of a world; `broken` is asked every few seconds."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._seen: dict[int, tuple[object, ...]] = {}  # By system: all that decides what is shown
        self._changed_s: dict[int, float] = defaultdict(float)

    def broken(self) -> list[str]:
        """Give the vehicles whose warning is missing, or is one without a reason."""
        world, found = self._world, []
        for system in world.vehicles:
            self._note_change(system)
            is_settled = world.scheduler.now_s - self._changed_s[system] >= SHOWN_S
            app = world.broker.app if world.broker.is_running else None
            if not is_settled or system in world.twinned or app is None:
                continue
            session = app.sessions.get(system)
            now_s = world.broker.clock.monotonic()
            if session is None or not session.vehicle.is_connected(now_s):
                continue
            is_reached = world.down[system].is_up
            if not is_reached and session.link_warning is None:
                found.append(f"vehicle {system} receives nothing, and nobody is warned")
            is_healthy = world.down[system].conditions.loss < MOST_LOSS
            if is_reached and is_healthy and session.link_warning is not None:
                found.append(f"vehicle {system} answers: {session.link_warning!r}")
        return found

    def _note_change(self, system: int) -> None:
        world = self._world
        up, down = world.up[system], world.down[system]
        seen = (
            *(up.is_up, up.changed_s, down.is_up, down.changed_s),
            *(world.vehicles[system].booted_at_s, world.connected_s[system]),
        )
        if self._seen.get(system) != seen:
            self._seen[system] = seen
            self._changed_s[system] = world.scheduler.now_s
