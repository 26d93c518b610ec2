"""The broker: missions from the edge server, flown over MAVLink on any autopilot."""
