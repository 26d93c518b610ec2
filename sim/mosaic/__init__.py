"""Pictures of a flight laid on the ground by what is written in them."""
