"""The AFarCloud information model: one vocabulary for the edge server and the broker."""
