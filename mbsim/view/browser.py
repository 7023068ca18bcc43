"""A real browser without a window, driven through its DevTools protocol.

A WebSocket client of the few things that the protocol needs (RFC 6455): text frames, one
connection, on this machine.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import urlopen

from mbsim.errors import ModelError

#: Names under which Chromium and its kin are found; `MBSIM_BROWSER` goes before.
_NAMES = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("microsoft-edge", "msedge"),
)
_FLAGS = (
    *("--headless", "--disable-gpu", "--hide-scrollbars", "--mute-audio", "--no-first-run"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-extensions"),
    *("--disable-background-networking", "--force-color-profile=srgb", "--remote-debugging-port=0"),
)
#: Longest wait for the browser to start, and for an answer [s].
_START, _ANSWER = 60.0, 300.0


def browser_path() -> str | None:
    """Return the browser of this machine, None where there is none."""
    asked = os.environ.get("MBSIM_BROWSER")
    if asked:
        return shutil.which(asked)
    return next((path for name in _NAMES if (path := shutil.which(name))), None)


def needed_browser() -> str:
    """Return the browser; ModelError where there is none, saying what would do."""
    path = browser_path()
    if path is None:
        raise ModelError(
            "pictures are made by a browser: none of chromium, google-chrome, microsoft-edge is "
            "there; install one (Debian: apt-get install chromium), or name it by MBSIM_BROWSER"
        )
    return path


class Page:
    """A page of a browser: `call` a method of the protocol, `run` a script.

    `console` has what the page wrote to its console as warnings and errors, and uncaught
    exceptions; `requests` the addresses that it asked for.
    """

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        self._socket = socket.create_connection(
            (str(parts.hostname), int(parts.port or 80)), _ANSWER
        )
        key = base64.b64encode(os.urandom(16)).decode()
        self._socket.sendall(
            (
                f"GET {parts.path} HTTP/1.1\r\nHost: {parts.netloc}\r\nUpgrade: websocket\r\n"
                f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n"
                "Sec-WebSocket-Version: 13\r\n\r\n"
            ).encode()
        )
        self._left = b""
        while b"\r\n\r\n" not in self._left:
            self._left += self._received()
        head, _, self._left = self._left.partition(b"\r\n\r\n")
        if b" 101 " not in head.split(b"\r\n")[0]:
            raise ModelError("the browser does not take a connection")
        self._number = 0
        self.console: list[str] = []
        self.requests: list[str] = []
        self._loaded = False
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def _received(self) -> bytes:
        data = self._socket.recv(1 << 20)
        if not data:
            raise ModelError("the browser has ended")
        return data

    def _take(self, count: int) -> bytes:
        parts, size = [self._left], len(self._left)
        while size < count:
            parts.append(self._received())
            size += len(parts[-1])
        whole = b"".join(parts)
        self._left = whole[count:]
        return whole[:count]

    def _send(self, text: str) -> None:
        data, mask = text.encode(), os.urandom(4)
        size = len(data)
        if size < 126:
            head = struct.pack("!BB", 0x81, 0x80 | size)
        elif size < 1 << 16:
            head = struct.pack("!BBH", 0x81, 0x80 | 126, size)
        else:
            head = struct.pack("!BBQ", 0x81, 0x80 | 127, size)
        repeated = mask * (size // 4 + 1)
        masked = int.from_bytes(data, "big") ^ int.from_bytes(repeated[:size], "big")
        self._socket.sendall(head + mask + masked.to_bytes(size, "big"))

    def _message(self) -> dict[str, Any]:
        """Return the next message; what is sent in pieces is put together."""
        data, last = b"", False
        while not last:
            first, second = self._take(2)
            size = second & 0x7F
            if size == 126:
                (size,) = struct.unpack("!H", self._take(2))
            elif size == 127:
                (size,) = struct.unpack("!Q", self._take(8))
            part, kind = self._take(size), first & 0x0F
            if kind == 8:
                raise ModelError("the browser has ended")
            if kind in (0, 1):
                data, last = data + part, bool(first & 0x80)
        found: dict[str, Any] = json.loads(data)
        return found

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Return the answer to a method; `ModelError` where the browser refuses it."""
        self._number += 1
        number = self._number
        self._send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = self._message()
            if message.get("id") == number:
                if "error" in message:
                    raise ModelError(f"the browser: {method}: {message['error']['message']}")
                result: dict[str, Any] = message["result"]
                return result
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        """Keep what an event says."""
        facts = message.get("params", {})
        match message.get("method"):
            case "Page.loadEventFired":
                self._loaded = True
            case "Network.requestWillBeSent":
                self.requests.append(facts["request"]["url"])
            case "Runtime.exceptionThrown":
                details = facts["exceptionDetails"]
                said = details.get("exception", {}).get("description") or details["text"]
                self.console.append(str(said))
            case "Runtime.consoleAPICalled" if facts["type"] in ("error", "warning", "assert"):
                words = [str(a.get("value", a.get("description", ""))) for a in facts["args"]]
                self.console.append(" ".join(words))
            case "Log.entryAdded" if facts["entry"]["level"] in ("error", "warning"):
                self.console.append(facts["entry"]["text"])

    def open(self, address: str) -> None:
        """Open an address and wait until it is loaded."""
        self._loaded = False
        self.call("Page.navigate", url=address)
        while not self._loaded:
            self._note(self._message())

    def run(self, script: str) -> Any:
        """Return the value of an expression, or of the promise that it is."""
        answer = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            said = details.get("exception", {}).get("description") or details["text"]
            raise ModelError(f"the page: {said}")
        return answer["result"].get("value")

    def size(self, width: int, height: int, mobile: bool = False, ratio: float = 1.0) -> None:
        """Let the window be so large."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=ratio,
            mobile=mobile,
        )

    def picture(self) -> bytes:
        """Return what the window shows as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        """Let go of the connection."""
        self._socket.close()


def _end_with_parent() -> None:
    """Have Linux end this process when the one that started it ends, however that ends."""
    import ctypes
    import signal

    set_death_signal = 1  # PR_SET_PDEATHSIG of prctl(2); exec keeps it
    ctypes.CDLL(None).prctl(set_death_signal, signal.SIGKILL)


@contextlib.contextmanager
def opened_page(width: int = 1280, height: int = 800) -> Iterator[Page]:
    """Start the browser with a profile of its own, and yield its page; it ends afterwards."""
    path = needed_browser()
    with tempfile.TemporaryDirectory(prefix="mbsim-browser-", ignore_cleanup_errors=True) as folder:
        flags = [*_FLAGS, f"--user-data-dir={folder}", f"--window-size={width},{height}"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            flags.append("--no-sandbox")  # it cannot be had by root
        process = subprocess.Popen(
            [path, *flags, "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            preexec_fn=_end_with_parent if sys.platform == "linux" else None,
        )
        try:
            page = Page(_address(process, Path(folder)))
            try:
                page.size(width, height)
                yield page
            finally:
                with contextlib.suppress(OSError, ModelError):
                    page.call("Browser.close")
                page.close()
        finally:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _address(process: subprocess.Popen[bytes], folder: Path) -> str:
    """Return where the page of a browser that has just been started is driven from."""
    file, until = folder / "DevToolsActivePort", time.monotonic() + _START
    while time.monotonic() < until:
        if process.poll() is not None:
            raise ModelError(f"the browser ended at once, exit code {process.returncode}")
        with contextlib.suppress(OSError, ValueError, IndexError, StopIteration):
            port = int(file.read_text().split()[0])
            with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=10) as answer:
                pages = json.load(answer)
            return str(next(p["webSocketDebuggerUrl"] for p in pages if p["type"] == "page"))
        time.sleep(0.02)
    raise ModelError("the browser does not start")
