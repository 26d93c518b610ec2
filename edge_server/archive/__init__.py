"""The flight archive: what was flown stays on the farm, in a database file of its own."""
