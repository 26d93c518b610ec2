"""The persons of a simulated farm."""
