"""Where robots come from: URDF, MJCF, SRDF, Denavit-Hartenberg rows, the table of names."""
