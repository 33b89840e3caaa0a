"""Grips: which hand can hold what from where along a path, and which of them come too near to each other."""
