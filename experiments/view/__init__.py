"""A run's scene, served on this computer alone."""
