"""Other programs' mission files in and out: `.plan`, `.waypoints`, mission items. Pure."""
