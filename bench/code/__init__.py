"""The exported C tick beside the Python tick: cycles, nanoseconds and instructions of the same path."""
