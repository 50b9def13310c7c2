"""What a job writes for eyes: the report and the viewer, of what it has so far and of what came out."""
