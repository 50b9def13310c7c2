"""Studies over rooms with ground truth, each a table: what a choice buys, and what it costs."""
