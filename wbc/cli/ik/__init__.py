"""Inverse kinematics on the command line."""
