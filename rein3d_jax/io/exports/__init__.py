"""Data sets for other tools: COLMAP, nerfstudio."""
