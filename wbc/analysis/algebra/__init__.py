"""Exact algebra of joint angles: polynomials in sines and cosines, their roots and branches."""
