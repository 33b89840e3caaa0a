"""Exact algebra of joint angles: polynomials in sines and cosines, their roots and branches."""

from wbc import extras

extras.require("analysis", "exact rank analysis")
