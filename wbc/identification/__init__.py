"""Inertias from motion and torques."""
