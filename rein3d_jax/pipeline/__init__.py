"""The stages joined, pure of files."""
