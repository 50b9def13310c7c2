"""The full-size restoration network: Wan2.1-VACE-1.3B with its VAE, in JAX, adapted to panoramas (paper, Sec. 4.2)."""
