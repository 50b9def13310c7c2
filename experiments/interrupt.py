"""Ctrl-C ends a command soon. Python's KeyboardInterrupt waits for what computes in C, a compiler above all, and then
for worker threads: minutes. While a command's modules are imported, a second or two, it would be a traceback."""

import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

INTERRUPTED = 130  # the exit code, as shells have it: 128 + SIGINT
_GRACE = 3.0  # seconds in which a command may end by itself
_SHOW_CURSOR = "\033[?25h"  # a progress bar hides it


def is_a_command() -> bool:
    """Whether this process is one, now that the first module of `experiments` is imported: `python -m experiments...`,
    which Python calls -m until it has found the module, or the script."""
    name = (sys.argv or [""])[0]
    return name == "-m" or Path(name).stem == "rein3d"


def ends_at_once() -> None:
    """From here to `ends_soon` a Ctrl-C ends the process with one line: nothing is begun yet."""
    if _is_ours():
        signal.signal(signal.SIGINT, _leave)


def _leave(*_) -> None:
    os.write(2, b"interrupted before anything was begun\n")  # print may be what was interrupted
    os._exit(INTERRUPTED)


@contextmanager
def ends_soon(line: str) -> Iterator[None]:
    """Within, a Ctrl-C raises KeyboardInterrupt as ever. A process that is still within _GRACE seconds later prints
    `line` and is ended; files are written whole or not at all, so none is damaged."""
    if signal.getsignal(signal.SIGINT) is _leave and _in_main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if not _is_ours():
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


def _is_ours() -> bool:
    """Whether Ctrl-C is still Python's own."""
    return _in_main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
