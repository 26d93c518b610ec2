"""Monitors rotors, attitude and inertial sensor; PX4's failure_detector."""
