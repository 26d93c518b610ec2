"""From the boundary of a field to the flights that cover it."""
