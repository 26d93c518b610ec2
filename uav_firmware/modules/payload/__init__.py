"""Camera and gimbal: pictures, video, pointing, tracking, panoramas."""
