"""Which frame reaches whom: links of a vehicle, signatures, duplicate system ids."""
