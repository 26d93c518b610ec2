"""Trajectory to attitude and thrust; PX4's mc_pos_control."""
