"""Which coordinates an arm, or a tree of arms, has: its parts, published or found."""
