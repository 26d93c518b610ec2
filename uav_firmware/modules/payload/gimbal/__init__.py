"""The gimbal: where the camera points, and who says so."""
