"""The simulated camera: pictures of the farm from the vehicle's true place, and their files."""
