"""Set-points that move along legs, and the heading."""
