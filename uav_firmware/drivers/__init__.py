"""Drivers: each implements the protocols of cal for one vehicle, link or medium."""
