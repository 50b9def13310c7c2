"""Training of the full-size network, Wan2.1-VACE."""
