"""The farm as the camera sees it: lens, ground, crops, hills, structures, and what hides what."""
