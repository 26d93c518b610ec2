"""What a broker must know again after its own death: a page for each vehicle, on the disk."""
