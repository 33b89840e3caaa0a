"""Strict levels: one least-squares problem after the other, and their derivatives."""
