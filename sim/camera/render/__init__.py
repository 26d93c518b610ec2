"""A picture of the scene: each pixel's ray, light and exposure."""
