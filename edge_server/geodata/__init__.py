"""Geodata in and out: boundaries of fields, projections, georeferenced pictures. Pure."""
