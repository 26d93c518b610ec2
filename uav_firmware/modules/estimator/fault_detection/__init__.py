"""Detection of bad inertial samples, and of biases that jump or drift."""
