"""The benchmark: this package and its peers on the same problems (``make bench``)."""
