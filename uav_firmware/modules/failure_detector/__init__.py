"""Watches rotors and attitude; PX4's failure_detector."""
