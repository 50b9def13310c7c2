"""Furnished rooms rendered by Blender Cycles: planned here with numpy, drawn by `blender` in its own environment."""
