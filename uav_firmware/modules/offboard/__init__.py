"""Offboard mode: set-points streamed by a companion computer or ground station."""
