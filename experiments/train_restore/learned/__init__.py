"""Training of the learned restorer, the small network."""
