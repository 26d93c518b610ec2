"""What stands between the network and the threads that serve: only whole requests pass."""
