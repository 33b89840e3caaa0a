"""Torques under a walk: a loop that follows its rates on a robot with masses, and what may go wrong with it."""
