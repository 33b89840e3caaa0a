"""Swings: the curve of a hand from hold to hold, its joints, least time, clearance and law."""
