"""Furniture: its catalogue, its parts, and where it fits into a plan."""
