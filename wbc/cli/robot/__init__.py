"""Commands that show robots and the pairs of links that must not touch."""
