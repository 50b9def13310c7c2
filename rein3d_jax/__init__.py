"""rein3d_jax: one indoor panorama in, one explorable 3D Gaussian scene out. Stages are pure functions over pytrees."""

__version__ = "0.1.0"
