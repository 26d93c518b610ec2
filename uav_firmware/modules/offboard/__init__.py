"""Offboard: set-points that a companion or ground station streams."""
