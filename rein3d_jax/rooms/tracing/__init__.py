"""A room as a picture: exact intersections, light, materials under a pixel's footprint."""
