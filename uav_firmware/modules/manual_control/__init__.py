"""Manual control: what sticks mean in each of the piloted modes."""
