"""Which pairs an arm can be commanded by, and which to take where: modes, advice, written restrictions."""
