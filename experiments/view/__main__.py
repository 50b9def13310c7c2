"""A run's scene in the browser, served on this computer alone.

    python -m experiments.view runs/room [--port 8360]

While the job still runs it shows how far it is, its curves, and the scene as it is so far. For scenes too big for one
viewer.html, too: the page fetches them one at a time.
"""

import argparse
import sys

from experiments.command import CommandParser
from experiments.run_folder import open_run
from experiments.view.pages import pages
from experiments.view.server import LOOPBACK, server


def main(arguments: list[str] | None = None) -> int:
    """Serves until Ctrl-C. Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("view", __doc__)
    parser.add_argument("run", metavar="RUN_FOLDER", help="what reconstruct writes or wrote")
    parser.add_argument("--port", type=int, default=8360, help="0 takes a free one (default: %(default)s)")
    return parser.run(_serve, arguments)


def _serve(options: argparse.Namespace) -> None:
    with server(pages(open_run(options.run)), options.port) as running:
        print(f"http://{LOOPBACK}:{running.server_port}/ shows {options.run}; Ctrl-C ends it", flush=True)
        try:
            running.serve_forever()
        except KeyboardInterrupt:
            print()


if __name__ == "__main__":
    sys.exit(main())
