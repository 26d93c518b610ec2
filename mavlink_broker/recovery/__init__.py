"""What must be known of each vehicle after the broker's own death, on the disk."""
