import uav_firmware  # noqa: F401 - first: it loads what is compiled, and the simulation with it
