"""Figures on pages: measured by a command, kept in a file with commit, date and machine, written into marked blocks."""
