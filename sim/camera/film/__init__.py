"""Files of pictures and video, the process that makes them, and the live view."""
