"""Command lines that join the stages: `python -m experiments.NAME --config recipe.toml --set stage.key=value`."""

from experiments.interrupt import ends_at_once, is_a_command

if is_a_command():
    ends_at_once()
