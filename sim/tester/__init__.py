"""A person at a keyboard in the vehicle's stead, on MAVSDK's server plugins."""
