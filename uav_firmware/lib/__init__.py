"""Mathematics shared by the modules: rotations, geodesy, filters."""
