"""Other programs' files in and out: field boundaries and missions. Pure."""
