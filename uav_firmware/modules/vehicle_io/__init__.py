"""Between the bus and the hardware: motors out, one step of time, samples in."""
