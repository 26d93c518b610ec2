"""Plans: from a field, a mission file or a request to stored missions that wait for the broker."""
