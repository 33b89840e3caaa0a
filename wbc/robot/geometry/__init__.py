"""Shapes of links: read, fitted to meshes, covered."""
