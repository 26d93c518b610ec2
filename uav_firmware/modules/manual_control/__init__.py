"""Manual control: setpoints from the sticks in each piloted mode."""
