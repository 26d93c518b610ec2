"""A person at a keyboard in the vehicle's place, on MAVSDK's server plugins."""
