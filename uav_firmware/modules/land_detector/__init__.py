"""Whether the vehicle stands or flies; PX4's land_detector."""
