"""Shapes of links: read, fitted to meshes, covered, and as segments and geometries of Coal."""
