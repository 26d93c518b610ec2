"""The command protocol: what arrives, what is answered, what is repeated."""
