"""The gimbal: where the camera points, and who may point it."""
