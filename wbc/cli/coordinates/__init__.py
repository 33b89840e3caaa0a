"""Commands about coordinates: where they lose rank, in which modes and by which pairs arms are commanded."""
