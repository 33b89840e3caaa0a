"""Laws of motion: paths, timings, and certificates of the limits that they keep."""
