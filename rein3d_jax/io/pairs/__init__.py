"""Pairs of clips as records in checksummed shards."""
