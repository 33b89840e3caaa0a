"""Every QP solver on one set of random problems, and the exact minimiser that judges them."""
