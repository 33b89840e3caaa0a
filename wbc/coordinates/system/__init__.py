"""Coordinates of several arms that move one thing, or stand on one."""
