"""Reports of vehicles: received, applied to the work, corrected, and stored until confirmed."""
