"""AFarCloud's words to MAVLink's and back; all pure, per family of autopilot by tables."""
