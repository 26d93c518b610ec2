"""Navigator: missions and modes become a flyable trajectory."""
