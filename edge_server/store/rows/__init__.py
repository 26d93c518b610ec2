"""Tables, and a module of queries per kind of row."""
