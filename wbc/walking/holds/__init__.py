"""Holds and structures: what a walker can take hold of, as objects, files and built-in layouts."""
