"""Proofs that a set of coordinates has full rank everywhere, by subdivision with bounds."""
