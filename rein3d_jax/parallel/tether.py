"""A tether between the processes of one job: where one ends, all end soon, and each says why in a line.

Without it the others wait: in a sum over devices, some for ever, or for minutes at their own end. A TCP connection
leads from process 0 to each other one; lines of text go over it: "alive" from time to time, "done", or "ended", the
number and the reason. A connection that closes, or is silent for too long, tells of a process that was killed.
"""

import atexit
import os
import secrets
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import jax
import numpy as np
from jax.experimental import multihost_utils

from rein3d_jax.errors import InputError

_BEAT, _SILENCE = 5.0, 60.0  # seconds from one "alive" to the next, and without one until a process counts as lost
_GRACE = 5.0  # seconds in which a failed sum over devices turns out to be another process's end
_KILLED = "was killed or cut off: start all again with --resume, as many as you like"
_EXIT = 2


@contextmanager
def tethered(address: str | None, say: Callable[[str], None]) -> Iterator[None]:
    """Within, the processes that `join_hosts` joined at `address` ("host:port") end together: where another one ends,
    this one calls `say` with one line and leaves with exit code 2; where this one raises, the others are told why. With
    no address there is one process, and nothing happens."""
    if address is None:
        yield
        return
    tether = _Tether(_links(address.rpartition(":")[0]), say)
    try:
        yield
    except (Exception, KeyboardInterrupt) as error:
        tether.fail(error)
        raise
    tether.finish()


class _Tether:
    """This process's ends of the connections, by the number of the process at the other end."""

    def __init__(self, links: dict[int, socket.socket], say: Callable[[str], None]):
        self.links, self.say, self.index = links, say, jax.process_index()
        self.ending, self.finished = threading.Lock(), threading.Event()
        self.watchers = [threading.Thread(target=self._watch, args=link, daemon=True) for link in links.items()]
        for thread in (*self.watchers, threading.Thread(target=self._beat, daemon=True)):
            thread.start()

    def finish(self) -> None:
        """Returns when all processes are done."""
        self._tell("done")
        for thread in self.watchers:
            thread.join()
        self.finished.set()

    def fail(self, error: BaseException) -> None:
        """Tells the others of this process's own error; but where another one ended, that is what the error comes of,
        and this process ends here."""
        if not isinstance(error, InputError | KeyboardInterrupt):
            self.finished.wait(_GRACE)
        if not self.ending.acquire(blocking=False):
            threading.Event().wait()  # a watcher ends the process
        self._tell(f"ended {self.index} ended: {str(error) or type(error).__name__}")
        atexit.register(self._leave)  # once the error is said; jax would wait for the others

    def _watch(self, other: int, link: socket.socket) -> None:
        ended = f"ended {other} {_KILLED}"
        try:
            with link.makefile(encoding="utf-8") as lines:
                for line in map(str.strip, lines):
                    if line == "done":
                        return
                    if line.startswith("ended"):
                        ended = line
                        break
        except OSError:
            pass  # reset, or silent for too long
        if self.ending.acquire(blocking=False):
            self._tell(ended)
            _, who, how = ended.split(" ", 2)
            self.say(f"process {who} of {jax.process_count()} {how}")
            self._leave()

    def _leave(self) -> None:
        """Process 0 leaves last: jax's own coordination ends with it, and would have its say."""
        for thread in self.watchers if self.index == 0 else []:
            if thread is not threading.current_thread():
                thread.join(_GRACE)
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_EXIT)

    def _beat(self) -> None:
        while not self.finished.wait(_BEAT):
            self._tell("alive")

    def _tell(self, line: str) -> None:
        for link in self.links.values():
            try:
                link.sendall(f"{' '.join(line.split())}\n".encode())
            except OSError:
                continue  # its watcher sees it, too


def _links(host: str) -> dict[int, socket.socket]:
    """Connections to process 0, or from there to all. Strangers do not know the token."""
    first = jax.process_index() == 0
    with socket.create_server(("", 0), backlog=jax.process_count()) as server:
        told = np.array([server.getsockname()[1], secrets.randbits(31)], np.int32)
        port, token = map(int, multihost_utils.broadcast_one_to_all(told))
        if first:
            server.settimeout(_SILENCE)
            return _accepted(server, token)
    link = socket.create_connection((host, port), timeout=_SILENCE)
    link.sendall(f"{token} {jax.process_index()}\n".encode())
    return {0: link}


def _accepted(server: socket.socket, token: int) -> dict[int, socket.socket]:
    links = {}
    while len(links) < jax.process_count() - 1:
        try:
            link, _ = server.accept()
            link.settimeout(_SILENCE)
            said = link.makefile(encoding="ascii").readline(32).split()
        except OSError as error:
            missing = set(range(1, jax.process_count())) - links.keys()
            raise InputError(
                f"processes {missing} do not reach process 0 at port {server.getsockname()[1]}: open the ports "
                "between the hosts"
            ) from error
        if len(said) == 2 and said[0] == str(token):
            links[int(said[1])] = link
    return links
