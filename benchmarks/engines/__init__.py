"""Rasterizers that are timed beside each other: ours, its first prototype, and gsplat's torch reference."""
