"""Pictures, distance maps and films."""
