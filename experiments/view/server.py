"""A web server on the loopback interface that answers for listed paths and nothing else."""

from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

from rein3d_jax.errors import InputError

LOOPBACK = "127.0.0.1"
Pages = Mapping[str, tuple[str, Callable[[], bytes]]]  # path -> media type, and what makes the content


def server(pages: Pages, port: int) -> ThreadingHTTPServer:
    """A server of `pages`, bound to LOOPBACK and not yet running. No request's path reaches a file system: it is a key
    of `pages` or it is not. Raises InputError where the port cannot be had."""
    handler = type("Handler", (_Handler,), {"pages": pages})
    try:
        return ThreadingHTTPServer((LOOPBACK, port), handler)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"--port {port} cannot be had ({reason}): give another, or 0 for any that is free") from error


class _Handler(BaseHTTPRequestHandler):
    pages: Pages

    def do_GET(self) -> None:
        if not self._is_for_us():
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", b"open this server by its own address\n")
            return
        media, make = self.pages.get(urlsplit(self.path).path, ("text/plain", None))
        try:
            content = None if make is None else make()
        except InputError as error:  # not there yet, or being written
            content, reason = None, str(error)
        else:
            reason = "nothing here"
        if content is None:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", f"{reason}\n".encode())
        else:
            self._answer(HTTPStatus.OK, media, content)

    def _is_for_us(self) -> bool:
        """A foreign page can make its own name resolve to this computer; the browser then says that name here."""
        return self.headers.get("Host", "").partition(":")[0] in (LOOPBACK, "localhost")

    def _answer(self, status: HTTPStatus, media: str, content: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{media}; charset=utf-8" if media.startswith("text/") else media)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_) -> None:
        """Silent: the terminal shows the address."""
