"""Commands of published methods, as they were."""
