"""Draw rooms that come as JSON lines on standard input: {"room": plan, "folder": target, "settings": {...}}.
Where the settings list "emptied" parts, these are made for the panoramas that are there.

Answers each with one line `done SECONDS PANORAMAS` or `failed REASON` on standard output."""

import json
import os
import sys
import time
import traceback

from experiments.render_rooms.blender.room import draw_emptied, draw_room


def serve_jobs() -> None:
    """Serve jobs until standard input ends. Blender's own talk goes to standard error."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        job = json.loads(line)
        began = time.process_time()
        try:
            draw = draw_emptied if job["settings"].get("emptied") else draw_room
            count = draw(job["room"], job["folder"], job["settings"])
            answers.write(f"done {time.process_time() - began:.1f} {count}\n")
        except Exception as error:  # the next room may well succeed; the caller counts
            traceback.print_exc()
            answers.write(f"failed {type(error).__name__}: {' '.join(str(error).split())}\n")
        answers.flush()


if __name__ == "__main__":
    serve_jobs()
