"""Log of a training run: a line of JSON for each record, and TensorBoard events of the same numbers."""

import json
from pathlib import Path

import numpy as np
from tensorboardX import SummaryWriter


class TrainingLog:
    """Appends to log.jsonl, and to event files, in one folder. A context manager."""

    def __init__(self, folder: str | Path):
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.lines = folder / "log.jsonl"
        self.events = SummaryWriter(str(folder), flush_secs=30)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.events.close()

    def record(self, step: int, values: dict[str, float]) -> None:
        """Logs the numbers of one step; those that are not finite become null in the JSON."""
        plain = {name: float(value) for name, value in values.items()}
        finite = {name: value if np.isfinite(value) else None for name, value in plain.items()}
        with open(self.lines, "a", encoding="utf-8") as lines:
            lines.write(json.dumps({"step": step, **finite}) + "\n")
        for name, value in plain.items():
            self.events.add_scalar(name, value, step)

    def picture(self, step: int, name: str, rgb: np.ndarray) -> None:
        """Logs an sRGB picture (h, w, 3) in [0, 1]."""
        self.events.add_image(name, np.moveaxis(np.clip(rgb, 0, 1), -1, 0), step)
