"""Further ways to the cloud beside HTTP; each gives the relay the answers that HTTP would give."""
