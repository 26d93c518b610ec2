"""States of vehicles that the database has refused: readers see the newest, not the last stored.

Otherwise a vehicle would seem to stand still while the disk is full. A state is in memory until a
newer one is stored, or the process ends.
"""

import threading

from edge_server.store.rows.vehicles import StoredVehicle


class UnstoredStates:
    """The newest state of each vehicle whose last report was not stored; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._states: dict[int, tuple[StoredVehicle, float]] = {}  # And when the stored one came

    def keep(self, state: StoredVehicle, stored: StoredVehicle) -> None:
        """Keep a state that could not take the place of a stored one."""
        with self._lock:
            self._states[state.vehicle_id] = state, stored.updated_at

    def forget(self, vehicle_id: int) -> None:
        """Forget the state of a vehicle: a newer one is stored, or the vehicle is deleted."""
        with self._lock:
            self._states.pop(vehicle_id, None)

    def newest(self, stored: StoredVehicle) -> StoredVehicle:
        """Return the newest state of a stored vehicle.

        Another server on the same database may have stored a newer one than is kept here.
        """
        with self._lock:
            state, stored_at = self._states.get(stored.vehicle_id, (stored, stored.updated_at))
        return state if stored.updated_at == stored_at else stored
