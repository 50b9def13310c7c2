"""Figures of a picture that has no truth to compare with: NIQE and BRISQUE."""
