"""The learned restorer: a small network that corrects the background-first fill, in colour and distance."""
