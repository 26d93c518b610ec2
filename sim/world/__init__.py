"""The farm that the simulated vehicle flies over: what there is to be seen and measured."""
