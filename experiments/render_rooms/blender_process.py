"""Blender's Python as a child process that draws one room after another."""

import json
import os
import subprocess
from pathlib import Path

from rein3d_jax.errors import InputError

_ROOT = Path(__file__).resolve().parents[2]
_ROOMS_A_PROCESS = 40  # loaded models stay in memory: about 20 MB a room


class BlenderProcess:
    """Started when needed, replaced after a crash or when it has grown."""

    def __init__(self, python: Path, log: Path):
        if not python.exists():
            install = f"{python} -m pip install -r {Path(__file__).parent}/requirements.txt"
            raise InputError(f"{python} does not exist; run: python3.11 -m venv {python.parents[1]} && {install}")
        self._python, self._log = python, log
        self._child: subprocess.Popen | None = None
        self._rooms = 0

    def draw(self, plan: dict, folder: Path, settings: dict) -> str:
        """Blender's answer: "done SECONDS PANORAMAS", or "failed REASON"."""
        if self._child is None or self._rooms >= _ROOMS_A_PROCESS:
            self.stop()
            self._start()
        self._rooms += 1
        job = {"room": plan, "folder": str(folder), "settings": settings}
        try:
            self._child.stdin.write(json.dumps(job) + "\n")
            self._child.stdin.flush()
            answer = self._child.stdout.readline().strip()
        except BrokenPipeError:
            answer = ""
        if not answer:
            self.stop()
        return answer or f"failed: Blender ended; see {self._log}"

    def stop(self) -> None:
        """End the child, if there is one."""
        if self._child is not None:
            self._child.stdin.close()
            self._child.wait()
        self._child, self._rooms = None, 0

    def _start(self) -> None:
        self._child = subprocess.Popen(
            [self._python, "-m", "experiments.render_rooms.blender"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log.open("w"),
            text=True,
            env={**os.environ, "PYTHONPATH": str(_ROOT), "PYTHONDONTWRITEBYTECODE": "1"},
        )
