"""Routes of reports, dead letters and the flight archive."""
