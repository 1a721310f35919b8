"""The server of the page, which this machine alone can reach: 127.0.0.1, and a token in the address.

It runs while the evaluation waits for a key, in the same thread. The page that was opened last drives.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import pathlib
import secrets
import time
from collections.abc import Coroutine
from typing import Any

import pydantic
from aiohttp import WSMsgType, web

from mazebench import stopping
from mazebench.constants import STEP_TIME
from mazebench.errors import InputError

_HOSTS = ("127.0.0.1", "localhost")  # another name in a request is of a page elsewhere that points here
_HERE = pathlib.Path(__file__).parent
_FILES = {"": _HERE / "page.html", **{name: _HERE / name for name in ("page.js", "page.css")}}
_FILES["canvas.js"] = _HERE.parent / "report" / "canvas.js"
_PATIENCE = 0.1  # s between looks for a signal
_LONGEST_MESSAGE = 4096  # bytes


class _Message(pydantic.BaseModel):
    """A message of a page."""

    model_config = pydantic.ConfigDict(strict=True, extra="forbid")

    number: int  # of the view that it shows
    keys: list[str]  # that are down


class Page:
    """The page as it is now; a context manager."""

    def __init__(self, port: int = 0):
        """Raises `InputError` if the port is taken; 0 takes a free one."""
        self._port, self._token, self._loop = port, secrets.token_urlsafe(16), asyncio.new_event_loop()
        self._socket: web.WebSocketResponse | None = None  # of the page that drives
        self._view: dict[str, Any] = {"number": 0, "phase": "wait"}
        self._held: list[str] = []  # the keys that are down
        self._seen = 0  # the number of the view that the page has
        self._pressed: list[str] = []  # the keys that were down when one of them was pressed in this view
        self._changed = asyncio.Event()  # a page has connected or sent keys
        self._next_step = 0.0  # s, when the next step may be taken
        app = web.Application(middlewares=[self._guard])
        app.router.add_get(f"/{self._token}/socket", self._connect)
        for name in _FILES:
            app.router.add_get(f"/{self._token}/{name}", self._send_file)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.1)  # pages are not waited for

    @property
    def address(self) -> str:
        """The address to open."""
        return f"http://{_HOSTS[0]}:{self._port}/{self._token}/"

    def show(self, view: dict[str, Any]) -> None:
        """Shows another view: values by the names that page.js reads."""
        self._view = {"number": self._view["number"] + 1, **view}
        self._pressed = []
        if self._socket is not None:
            self._run(_send(self._socket, self._view))

    def wait_for_keys(self, real_time: bool = False) -> list[str]:
        """Returns the keys that are down in the view; waits until there are some, or in real time until a step is due.

        A step is due 0.16 s after the last one. While no page is open, time stands still.
        """
        self._run(self._wait(real_time))
        self._next_step = time.monotonic() + STEP_TIME
        return self._pressed or self._held

    async def _wait(self, real_time: bool) -> None:
        await asyncio.sleep(self._next_step - time.monotonic())
        while not (self._pressed or (self._held and self._is_seen) or (real_time and self._socket is not None)):
            self._changed.clear()
            await self._changed.wait()

    def _run(self, work: Coroutine[Any, Any, None]) -> None:
        """Runs work to its end, and the server meanwhile; raises `stopping.Stopped` if a signal asks for it."""
        task = self._loop.create_task(work)
        try:
            while not task.done():
                stopping.check()
                self._loop.run_until_complete(asyncio.wait([task], timeout=_PATIENCE))
        finally:
            task.cancel()
        task.result()

    async def _connect(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(max_msg_size=_LONGEST_MESSAGE)
        await socket.prepare(request)
        before, self._socket, self._held = self._socket, socket, []
        await _send(socket, self._view)
        if before is not None:
            await _send(before, {"phase": "elsewhere"})
        self._changed.set()
        async for message in socket:
            if message.type == WSMsgType.TEXT and self._socket is socket:
                self._take(message.data)
        if self._socket is socket:
            self._socket, self._held = None, []
        return socket

    async def _send_file(self, request: web.Request) -> web.FileResponse:
        return web.FileResponse(_FILES[request.path.rpartition("/")[2]])

    def _take(self, text: str) -> None:
        """Takes note of the keys in a message; one that can't be read is passed over."""
        try:
            message = _Message.model_validate_json(text)
        except pydantic.ValidationError:
            return
        before, self._seen = self._held, message.number
        self._held = [key for key in message.keys if key in self._view.get("keys", ())]
        if self._is_seen and not {*before}.issuperset(self._held):
            self._pressed = self._held
        self._changed.set()

    @property
    def _is_seen(self) -> bool:
        """True if the page has the view, so that steps do not run ahead of it."""
        return bool(self._seen == self._view["number"])

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Refuses a request without the token, or from a page of another origin."""
        token, host = request.path.split("/")[1], request.host.rpartition(":")[0] or request.host
        own = {None, f"http://{request.host}"}
        if (
            not secrets.compare_digest(token.encode(), self._token.encode())
            or host not in _HOSTS
            or request.headers.get("Origin") not in own
        ):
            raise web.HTTPForbidden(text="Open the address that `mazebench play` prints.\n")
        response: web.StreamResponse = await handler(request)
        return response

    async def _start(self) -> None:
        await self._runner.setup()
        site = web.TCPSite(self._runner, _HOSTS[0], self._port)
        await site.start()
        self._port = self._runner.addresses[0][1]

    def __enter__(self) -> Page:
        try:
            self._run(self._start())
        except OSError as error:
            fault = os.strerror(error.errno or 0)
            raise InputError(f"expected --port that is free, found {self._port}: {fault}") from error
        return self

    def __exit__(self, *error: object) -> None:
        for work in (self._runner.cleanup(), self._loop.shutdown_asyncgens()):
            self._loop.run_until_complete(work)
        self._loop.close()


async def _send(socket: web.WebSocketResponse, view: dict[str, Any]) -> None:
    with contextlib.suppress(ConnectionError):  # the page is gone
        await socket.send_json(view)
