"""Mathematics and rules shared by the modules: rotations, geodesy, motion, mission checks."""
