"""The camera component and its gimbal."""
