"""Kinematics of the walkers' arms in closed form; they know no structure."""
