"""Training of both restoration networks."""
