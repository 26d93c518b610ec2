"""Offboard mode: setpoints streamed by a companion computer or ground station."""
