"""The machine: its grid, arms and body, what they can reach, and what a cycle does to them."""
