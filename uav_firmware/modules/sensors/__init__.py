"""One sample from several instances of a sensor, and which of the instances have failed."""
