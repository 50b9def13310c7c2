"""Pairs of clips to train on, as shards."""
