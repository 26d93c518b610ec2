"""Attitude to body rates; PX4's mc_att_control."""
