"""What a cap on iterations does to the tails of a tick's duration, and what it costs."""
