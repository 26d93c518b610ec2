"""The work of the broker: events and missions, their states, and the vehicles that do it."""
