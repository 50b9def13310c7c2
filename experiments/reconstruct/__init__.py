"""The main job: one panorama in, one explorable scene out."""
