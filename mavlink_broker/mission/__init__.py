"""One mission on one vehicle: its states, its progress, who changed it, how it ends."""
