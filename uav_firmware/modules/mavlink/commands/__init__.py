"""The command protocol."""
