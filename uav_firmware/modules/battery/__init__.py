"""Charge of the battery, estimated from voltage and current."""
