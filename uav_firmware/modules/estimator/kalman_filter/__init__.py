"""The error-state Kalman filter: alignment, prediction, delayed measurements, gates, resets."""
