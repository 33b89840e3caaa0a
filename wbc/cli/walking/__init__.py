"""Walks on the command line: options, modes, keys, the published planner."""
