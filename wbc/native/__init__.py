"""C code as libraries: the compiler, the cache on disk, and how libraries are loaded (floor 1)."""
