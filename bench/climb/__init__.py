"""The table of climbing: robots by scenes, walked or refused, with times (``python -m bench.climb``)."""
