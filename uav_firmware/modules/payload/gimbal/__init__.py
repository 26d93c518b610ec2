"""The gimbal: attitude, control and orders."""
