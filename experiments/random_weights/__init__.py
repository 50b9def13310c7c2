"""Weights of an untrained diffusion network."""
