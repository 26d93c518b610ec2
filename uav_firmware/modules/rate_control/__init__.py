"""Body rates to normalised torque; PX4's mc_rate_control."""
