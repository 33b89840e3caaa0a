"""Random ticks on random stacks of random robots: nothing may fail, and every fall-back is counted."""
