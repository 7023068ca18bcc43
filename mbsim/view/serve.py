"""The view of result files by a server on this machine, renewed while runs go on."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from mbsim.errors import MbsimError, ResultsError
from mbsim.results.opening import read_apart
from mbsim.results.reading import open_results
from mbsim.view.page import packs_of, page, title_of
from mbsim.view.run_data import RunData
from mbsim.view.scene import read_scene

#: Only this machine is served.
HOST = "127.0.0.1"


class Served:
    """Packs of result files as they were published last."""

    def __init__(self, files: Sequence[Path], asked: Sequence[str] = ()) -> None:
        self.files, self.asked = list(files), list(asked)
        self._lock = threading.Lock()
        self._version = ""
        self._packs: list[RunData] = []
        self._running = True
        self._message = "no output row yet"
        self.title = " and ".join(file.stem for file in self.files)

    def _now(self) -> str:
        """Return what is another one whenever a file is published anew."""
        found = []
        for file in self.files:
            try:
                about = file.stat()
                found.append(f"{about.st_mtime_ns}-{about.st_ino}-{about.st_size}")
            except OSError:
                found.append("-")
        return "/".join(found)

    def renew(self) -> None:
        """Read the files anew if they have changed."""
        with self._lock:
            version = self._now()
            if version == self._version:
                return
            try:
                found = read_apart(self._read, *self.files)
                self._packs, self._running, self.title = found
                self._version = version
            except MbsimError as error:
                self._message = str(error)

    def _read(self) -> tuple[list[RunData], bool, str]:
        """Return packs, whether a run goes on, and title."""
        with ExitStack() as stack:
            scenes = [read_scene(stack.enter_context(open_results(file))) for file in self.files]
            running = any(scene.results.status == "running" for scene in scenes)
            return packs_of(scenes, self.asked), running, title_of(scenes)

    def state(self) -> dict[str, Any]:
        """Return what a page asks for now and then."""
        self.renew()
        with self._lock:
            return {
                "version": self._version,
                "runs": len(self._packs),
                "running": self._running,
                "message": self._message,
            }

    def pack(self, number: int) -> bytes | None:
        """Return a pack, None where there is none of this number."""
        with self._lock:
            return self._packs[number].data if 0 <= number < len(self._packs) else None

    def document(self) -> str:
        """Return the page."""
        return page(self.title, {"live": True}, connect="'self'")


def server(served: Served, port: int = 0) -> ThreadingHTTPServer:
    """Return a server of a page on this machine; port 0 takes a free one.

    Raises
    ------
    ResultsError
        If the port cannot be had.
    """

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            path = self.path.partition("?")[0].strip("/")
            if not _is_local(self.headers.get("Host", "")):
                self._answer(403, "text/plain", b"only this machine is served")
            elif path == "":
                self._answer(200, "text/html; charset=utf-8", served.document().encode())
            elif path == "state":
                self._answer(200, "application/json", json.dumps(served.state()).encode())
            elif re.fullmatch("pack/[0-9]", path):
                data = served.pack(int(path[5:]))
                if data is None:
                    self._answer(404, "text/plain", b"no such run")
                else:
                    self._answer(200, "application/octet-stream", data)
            else:
                self._answer(404, "text/plain", b"nothing is here")

        def _answer(self, code: int, kind: str, data: bytes) -> None:
            # a page that was closed waits for no answer
            with suppress(ConnectionError):
                self.send_response(code)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(data)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(data)

        def log_message(self, format: str, *arguments: Any) -> None:
            """Say nothing of each request."""

    try:
        return ThreadingHTTPServer((HOST, port), Handler)
    except OSError as error:
        raise ResultsError(f"port {port}: {error.strerror}") from None


def _is_local(host: str) -> bool:
    """Return whether a request names this machine: other sites' pages may not read here."""
    return host.rpartition(":")[0] in (HOST, "localhost") or host in (HOST, "localhost")
