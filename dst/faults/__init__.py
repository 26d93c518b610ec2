"""What goes wrong, when, and until when."""
