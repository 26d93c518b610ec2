"""Component abstraction layer: the protocols between the flight stack and one vehicle."""
