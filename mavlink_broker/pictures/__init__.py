"""Pictures that a vehicle takes: announced, counted, fetched and told to the edge server."""
