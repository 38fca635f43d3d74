"""The page of a view: serves rendercanvas's application at an address that nobody can guess.

The server listens on the loopback address unless another one is given. Every request, also of a
websocket, must contain a token, which is new in each run. All other requests get status 403.
"""

from __future__ import annotations

import asyncio
import hmac
import importlib.resources
import os
import secrets
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from contextlib import suppress
from typing import Any

from halfstep.errors import UsageError
from halfstep.viewer.events import is_message

HOST = "127.0.0.1"
# The view ends if no page opens within this many seconds after the last one was closed. A reloaded
# page opens sooner.
LEFT_ALONE = 5.0

_Message = MutableMapping[str, Any]
_Receive = Callable[[], Awaitable[_Message]]
_Send = Callable[[_Message], Awaitable[None]]
_Application = Callable[[_Message, _Receive, _Send], Awaitable[None]]


class Server:
    """The server of one page.

    Attributes:
        address: the address of the page, with the token.
    """

    def __init__(self, host: str, port: int, size: tuple[int, int]) -> None:
        """Listen at the host and port, so that the address is known.

        Args:
            host: the address or name to listen at.
            port: the port, or 0 for a free one.
            size: (width, height) of the picture at first, in logical pixels.

        Raises:
            UsageError: the system cannot listen there.
        """
        self._token = secrets.token_urlsafe(24)
        try:
            family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
            self._socket = socket.create_server((host, port), family=family)
        except socket.gaierror as error:
            raise UsageError(f"--host {host}: {error.strerror}") from None
        except OSError as error:
            # Python's own message is too long.
            why = os.strerror(error.errno) if error.errno else error
            raise UsageError(f"--host {host} --port {port}: {why}") from None
        except UnicodeError:
            raise UsageError(f"--host {host}: is no name of a machine") from None
        name = f"[{host}]" if family == socket.AF_INET6 else host
        self.address = f"http://{name}:{self._socket.getsockname()[1]}/{self._token}/"
        page = importlib.resources.files("halfstep.viewer").joinpath("page.html").read_text("utf-8")
        width, height = size
        self._page = page.replace("WIDTH", f"{width}").replace("HEIGHT", f"{height}").encode()
        self._server: Any = None

    def serve(self, left: Callable[[], None]) -> None:
        """Serve the page until `stop`. ``left`` is called when nobody has it open any more."""
        import uvicorn
        from rendercanvas.http import asgi

        config = uvicorn.Config(
            Guard(asgi, self._token, self._page, left),
            log_level="critical",
            lifespan="on",
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        asyncio.run(self._server.serve(sockets=[self._socket]))

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()

    def stop(self) -> None:
        """Make `serve` return."""
        if self._server is not None:
            self._server.should_exit = True


class Guard:
    """An ASGI application that passes requests with the token on to another application."""

    def __init__(
        self,
        application: _Application,
        token: str,
        page: bytes,
        left: Callable[[], None],
    ) -> None:
        self._application = application
        self._token = token
        self._page = page
        self._left = left
        self._pages = 0
        self._leaving: asyncio.TimerHandle | None = None

    async def __call__(self, scope: _Message, receive: _Receive, send: _Send) -> None:
        """Answer a request."""
        if scope["type"] == "lifespan":
            await self._application(scope, receive, send)
            return
        token, _, rest = scope["path"].removeprefix("/").partition("/")
        if not hmac.compare_digest(token.encode(), self._token.encode()):
            await self._refuse(scope, send)
        elif scope["type"] == "websocket":
            await self._connect(scope, receive, send)
        elif rest:
            await self._application(scope, receive, send)
        else:
            await _answer(send, 200, b"text/html; charset=utf-8", self._page)

    async def _refuse(self, scope: _Message, send: _Send) -> None:
        if scope["type"] == "websocket":
            # The server answers 403 if a websocket is closed before it is accepted.
            await send({"type": "websocket.close", "code": 1008})
        else:
            await _answer(send, 403, b"text/plain", b"the address lacks its token\n")

    async def _connect(self, scope: _Message, receive: _Receive, send: _Send) -> None:
        self._pages += 1
        if self._leaving is not None:
            self._leaving.cancel()
        try:
            with suppress(asyncio.CancelledError):
                await self._application(scope, _checked(receive), send)
        finally:
            self._pages -= 1
            if not self._pages:
                loop = asyncio.get_running_loop()
                self._leaving = loop.call_later(LEFT_ALONE, self._left)


def _checked(receive: _Receive) -> _Receive:
    """Messages of a page without those that no page of ours sends."""

    async def checked() -> _Message:
        while True:
            message = await receive()
            if message["type"] != "websocket.receive" or is_message(message.get("text") or ""):
                return message

    return checked


async def _answer(send: _Send, status: int, kind: bytes, body: bytes) -> None:
    headers = [(b"content-type", kind), (b"cache-control", b"no-store")]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
