"""Differences between autopilot families, as tables: modes, commands, parameters, texts. Pure."""
