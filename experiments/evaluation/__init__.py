"""The evaluation's parts: rooms, methods, protocols, figures over rooms, chart. `evaluate.py` joins them."""
