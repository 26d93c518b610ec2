"""The camera: orders, states, exposures, video, panoramas."""
