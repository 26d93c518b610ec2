"""Starts, watches and stops the programs of a whole system."""
