"""Procedural furnished rooms: a room by key, and RGB-distance panoramas of it."""
