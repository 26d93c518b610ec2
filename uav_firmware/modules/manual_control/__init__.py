"""Manual control: set-points from the sticks in each piloted mode."""
