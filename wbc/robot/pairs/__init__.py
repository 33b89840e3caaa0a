"""Pairs of links that must not touch: which they are, how they are found, and their file."""
