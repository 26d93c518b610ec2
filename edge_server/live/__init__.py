"""What changes on the farm, as it happens: one stream for every browser that watches."""
