"""The commands of the program at a terminal: run, fly, translate, vehicles, dead-letters."""
