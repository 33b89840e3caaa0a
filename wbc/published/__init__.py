"""Faithful reproductions of published methods, one package each: for comparison, no part of the product uses them."""
