"""The vehicle's side of the tester: its state, its missions and its MAVLink link."""
