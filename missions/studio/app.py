"""The routes of the studio, behind its gate: the page, the websocket, and records, as files and as reports."""

from collections.abc import AsyncIterator, Callable, Collection
from contextlib import asynccontextmanager
from pathlib import Path

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket

from missions.studio.access import Access
from missions.studio.form import BadMessage
from missions.studio.gate import KINDS, Gate
from missions.studio.ring import records_in, shown_folder
from missions.studio.session import Session
from missions.studio.studio import PAGE, Studio, edition

MOST_CLIENTS = 96
"""Websockets at once; a page has three."""

TRY_LATER = 1013
"""The code by which a websocket is closed for which there is no room."""

VERSION_MARK = 'name="version" content=""'
"""Where in the page its version is put in."""

REPORT_POLICY = "sandbox allow-scripts; frame-ancestors 'none'"
"""What a report may do: it runs its own script, which its own policy names, as a page of nobody's. The studio, its
cookie and its websocket are those of another site to it, whatever the record has in it."""

Opened = Callable[[], Studio]


def application(make: Opened, access: Access, *, hosts: Collection[str]) -> ASGIApp:
    """Return the studio as an ASGI application. ``make`` is called once its loop runs."""

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        studio = app.state.studio = make()
        try:
            async with studio.hub:
                yield
        finally:
            studio.fleet.close()

    return Gate(Starlette(routes=routes(), lifespan=lifespan), access, hosts)


def routes() -> list[BaseRoute]:
    """Return all routes."""
    return [
        WebSocketRoute("/ws", websocket),
        Route("/", page),
        Route("/records/{name}", fetched),
        Route("/reports/{name}", reported),
        Route("/{name}", asset),
    ]


async def websocket(socket: WebSocket) -> None:
    """Serve a client."""
    studio: Studio = socket.app.state.studio
    if studio.count >= MOST_CLIENTS:
        await socket.close(TRY_LATER)
        return
    role, sign_in = socket.scope["role"], socket.scope.get("sign_in")
    await Session(socket, role, studio.name(role), studio, sign_in=sign_in).run()


async def page(request: Request) -> Response:
    """Serve the page itself, with its version put in."""
    del request
    try:
        text = (PAGE / "index.html").read_text(encoding="utf-8")
    except OSError as error:
        raise HTTPException(503, "the page is not installed: install MissionTree anew") from error
    return HTMLResponse(text.replace(VERSION_MARK, f'name="version" content="{edition()}"'), headers=_again())


async def asset(request: Request) -> Response:
    """Serve a file of the page."""
    name = request.path_params["name"]
    if name == "index.html":
        return await page(request)
    path = next((each for each in PAGE.iterdir() if each.name == name), None)
    if path is None or path.suffix not in KINDS or not path.is_file():
        raise HTTPException(404)
    return FileResponse(path, media_type=KINDS[path.suffix], headers=_again())


async def fetched(request: Request) -> Response:
    """Serve a record, as a file to be kept."""
    found = _record(request)
    _tell(request, "download", "ok")
    return FileResponse(found, media_type="application/octet-stream", filename=found.name)


async def reported(request: Request) -> Response:
    """Serve the report of a record, as `mission report` writes it."""
    studio: Studio = request.app.state.studio
    try:
        text = await studio.report(_record(request).name)
    except BadMessage as error:
        _tell(request, "report", error.error)
        return PlainTextResponse(f"{error}\n" + (f"  try: {error.hint}\n" if error.hint else ""), 422)
    _tell(request, "report", "ok")
    return HTMLResponse(text, headers={"Content-Security-Policy": REPORT_POLICY})


def _record(request: Request) -> Path:
    """Return the record that is asked for: its pictures may be taken away, and an operator alone gets it."""
    if request.scope["role"] != "operator":
        raise HTTPException(403)
    try:
        found = next((path for path in records_in(shown_folder()) if path.name == request.path_params["name"]), None)
    except OSError as error:
        raise HTTPException(503, f"{shown_folder()}: {error.strerror}") from error
    if found is None:
        raise HTTPException(404)
    return found


def _tell(request: Request, word: str, outcome: str) -> None:
    """Write into the log which record has left the studio."""
    role, name = request.scope["role"], request.path_params["name"]
    request.app.state.studio.audit.tell(role, role, {"do": word, "name": name}, outcome)


def _again() -> dict[str, str]:
    """Return the header by which a browser asks each time whether there is another page."""
    return {"Cache-Control": "no-cache"}
