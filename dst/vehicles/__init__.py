"""Simulated vehicles: kinematic ones, and the project's own flight stack."""
