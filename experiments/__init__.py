"""Command lines that join the stages: `python -m experiments.NAME --config recipe.toml --set stage.key=value`."""
