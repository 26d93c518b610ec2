"""Secrets, certificates and who a caller is."""
