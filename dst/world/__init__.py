"""The real programs of a farm on simulated computers, and the network between them."""
