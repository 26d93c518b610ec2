"""The parameter protocol and the parameters' description."""
