"""Ctrl-C ends a command soon. Python's KeyboardInterrupt waits for what computes in C, a compiler above all, and then
for worker threads: minutes."""

import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

INTERRUPTED = 130  # the exit code, as shells have it: 128 + SIGINT
_GRACE = 3.0  # seconds in which a command may end by itself
_SHOW_CURSOR = "\033[?25h"  # a progress bar hides it


@contextmanager
def ends_soon(line: str) -> Iterator[None]:
    """Within, a Ctrl-C raises KeyboardInterrupt as ever. A process that is still within _GRACE seconds later prints
    `line` and is ended; files are written whole or not at all, so none is damaged."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler or not _in_main_thread():
        yield  # a job in the background does not hear Ctrl-C, and elsewhere it is someone else's
        return
    heard, told = socket.socketpair()
    told.setblocking(False)  # as set_wakeup_fd wants
    ended = threading.Event()
    threading.Thread(target=_watch, args=(heard, ended, line), daemon=True).start()
    before = signal.set_wakeup_fd(told.fileno(), warn_on_full_buffer=False)
    try:
        yield
    finally:
        ended.set()
        signal.set_wakeup_fd(before)
        told.close()


def _watch(heard: socket.socket, ended: threading.Event, line: str) -> None:
    with heard:
        while (number := heard.recv(1)) and number[0] != signal.SIGINT:
            pass  # another signal's
        if number and not ended.wait(_GRACE):
            sys.stdout.flush()
            print(_SHOW_CURSOR * sys.stderr.isatty() + line, file=sys.stderr, flush=True)
            os._exit(INTERRUPTED)


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
