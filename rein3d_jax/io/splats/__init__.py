"""Gaussian scenes as files: PLY, compressed PLY, SPZ, .splat."""
