"""What every engine offers to the stopwatch."""

import dataclasses
from collections.abc import Callable


@dataclasses.dataclass(frozen=True)
class Engine:
    """One workload, ready to run: `wait(forward())` returns when the picture is done."""

    forward: Callable
    gradient: Callable
    wait: Callable
    step: Callable | None = None  # forward, gradient and Adam's update of all leaves, from where the last one ended
    facts: dict = dataclasses.field(default_factory=dict)  # counts that belong to its rows
    parts: dict = dataclasses.field(default_factory=dict)  # stage -> call
