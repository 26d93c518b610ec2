"""The autopilot: PX4-style modules joined by typed topics."""

from uav_firmware.compiled import install

install()
