"""Tests of what the edge server makes of pictures."""
