"""The autopilot: PX4-style modules joined by typed topics."""
