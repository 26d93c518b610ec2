"""A mission's commands as mission items and live actions, per family of autopilots. Pure."""
