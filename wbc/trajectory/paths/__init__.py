"""Paths: joint coordinates or poses over a path coordinate s, without time."""
