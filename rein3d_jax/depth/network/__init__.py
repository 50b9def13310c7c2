"""A network that estimates a panorama's distance: backbone, horizon branch, dense decoder, and what trains them."""
