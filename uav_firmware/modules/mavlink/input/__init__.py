"""Streamed input: sticks, set-points, targets, gimbal orders."""
