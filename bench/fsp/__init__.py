"""Full Space Parameterization: what its spaces and steps cost, printed norms, and paths resolved as a whole."""
