"""The camera: orders, states, pictures, video, panoramas."""
