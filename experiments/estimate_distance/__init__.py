"""The command that writes a panorama's distance."""
