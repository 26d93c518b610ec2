"""Torque and thrust to motors; PX4's control_allocator."""
