"""Walks of the three-armed robot: speeds, spins, trenches and random layouts, all planned and carried out."""
