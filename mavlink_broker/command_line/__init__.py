"""What a person can ask the broker for at a terminal: run, translate, vehicles, fly."""
