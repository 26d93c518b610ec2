"""The vehicle's MAVLink interface: identity, telemetry, commands, missions, parameters."""
