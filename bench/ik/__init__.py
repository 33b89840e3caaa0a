"""Inverse kinematics on the protocol of TRAC-IK, beside the convergence loops of pink and mink."""
