"""Recovery records: the state of each vehicle that the broker needs after a crash, on disk."""
