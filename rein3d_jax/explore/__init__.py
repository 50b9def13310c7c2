"""Distance -> safe camera paths and evaluation viewpoints."""
