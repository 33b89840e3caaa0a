"""The search over stances: which hand goes where, and when."""
