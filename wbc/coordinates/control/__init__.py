"""An arm commanded by pairs: the stack of a pair, its conditioning, what is done near singular poses."""
