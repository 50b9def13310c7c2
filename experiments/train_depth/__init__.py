"""Training of the network that estimates a panorama's distance."""
