"""Whether the vehicle may be armed, and when its motors stop."""
