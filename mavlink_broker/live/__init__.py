"""Commands flown live: orbits, tracking, following, panoramas, series of pictures."""
