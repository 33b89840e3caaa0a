"""Distances between bodies that no expression states, measured with Coal (floor 2)."""
