"""Variants of a training recipe, each with several seeds, side by side."""
