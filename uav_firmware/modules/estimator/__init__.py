"""Estimator: attitude, velocity and position from inertial sensors, GPS, barometer, compass."""
