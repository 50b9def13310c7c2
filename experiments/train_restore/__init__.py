"""Training of both restoration networks: what they share, and a folder for each."""
