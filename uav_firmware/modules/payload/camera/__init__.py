"""The camera and its gimbal: states and timing, optics, storage, tracking, panoramas."""
