"""Examples that the small restorer learns from, as files."""
