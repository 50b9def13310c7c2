"""Walk through a run's scene in the browser, served on this computer alone.

    python -m experiments.view runs/room [--port 8360]

While the job still runs it shows how far it is, its curves, and the scene as it is so far. For scenes too big for one
viewer.html, too: the page fetches them one at a time.
"""

import argparse
import sys

from experiments.compile_cache import use_compile_cache
from experiments.run_folder import open_run
from experiments.view.pages import pages
from experiments.view.server import LOOPBACK, server
from rein3d_jax.errors import InputError


def main(arguments: list[str] | None = None) -> int:
    """Serves until Ctrl-C. Exit code 0, or 2 with one line on stderr where the input is at fault."""
    options = _parser().parse_args(arguments)
    use_compile_cache()
    try:
        with server(pages(open_run(options.run)), options.port) as running:
            print(f"http://{LOOPBACK}:{running.server_port}/ shows {options.run}; Ctrl-C ends it", flush=True)
            running.serve_forever()
    except InputError as error:
        print(f"view: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m experiments.view", description=__doc__.splitlines()[0])
    parser.add_argument("run", metavar="RUN_FOLDER", help="what reconstruct writes or wrote")
    parser.add_argument("--port", type=int, default=8360, help="0 takes a free one (default: %(default)s)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
