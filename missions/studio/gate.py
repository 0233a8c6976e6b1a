"""The one door of the studio: nothing gets by that has not shown a token, whether over HTTP or a websocket.

It stands before all routing and denies by default. It looks at the Host (a page from elsewhere whose name was pointed
at this computer asks for that name), at the Origin (browsers let any page open a websocket to anywhere), and at a token
or a cookie.
"""

import ipaddress
from collections.abc import Collection, Iterator, Mapping
from urllib.parse import parse_qs, urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from missions.studio.access import Access
from missions.studio.commands import Role

TOKEN = "token"  # noqa: S105 - the name of what carries it

POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""What a page may do: run, look and ask as it was served here, and nothing else; nobody frames it."""

HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
}

SIGN_IN = (
    "This is a studio of MissionTree, and you are not signed in.\n"
    "Open the link that `mission studio` has printed. If you came here by a link on another page, reload this one.\n"
)


class Gate:
    """An ASGI application in front of ``app``. ``hosts`` are the names by which the studio may be asked for.

    Addresses in figures are always good, as are ``localhost`` and its like: no other page has such a name. Who gets by
    has a ``role`` in the scope.
    """

    def __init__(self, app: ASGIApp, access: Access, hosts: Collection[str], cookie: str) -> None:
        self._app, self._access, self._cookie = app, access, cookie
        self._hosts = frozenset(host.lower() for host in hosts) | {"localhost"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request by, or answer it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] not in ("http", "websocket"):
            return
        refusal = self._refusal(scope) or self._signed_in(scope)
        if refusal is None:
            await self._app(scope, receive, _with_headers(send))
        else:
            await refusal(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> Response | None:
        """Return why nobody is to be answered who asks so."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._known(hosts[0]):
            return PlainTextResponse("not the name of this studio: mission studio --name NAME\n", 403)
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            return PlainTextResponse("only GET\n", 405)
        origins = headers.getlist("origin")
        if origins and not all(_same(origin, hosts[0]) for origin in origins):
            return PlainTextResponse("a page from elsewhere may not do this\n", 403)
        if scope["type"] == "websocket" and not origins and "authorization" not in headers:
            return PlainTextResponse("a websocket needs an Origin, or a token in Authorization\n", 403)
        return None

    def _signed_in(self, scope: Scope) -> Response | None:
        """Note in ``scope`` who asks; return what is answered to who has not shown a token, or shows one now."""
        headers = Headers(scope=scope)
        address = scope["client"][0] if scope.get("client") else ""
        query = parse_qs(scope["query_string"].decode("latin-1"))
        kind, _, bearer = headers.get("authorization", "").partition(" ")
        given = bearer.strip() if kind.lower() == "bearer" else query.get(TOKEN, [""])[0]
        if given:
            role = self._access.by_token(given, address)
            if role is None:
                shut = self._access.shut(address)
                words = "too many wrong tokens: wait a minute\n" if shut else "a wrong token\n"
                return PlainTextResponse(words, 429 if shut else 403, {"Retry-After": "60"} if shut else None)
            if not bearer and scope["type"] == "http":
                return self._entry(scope, query, role)
        else:
            shown = map(self._access.by_cookie, _cookies(headers.get("cookie", ""), self._cookie))
            found = next((role for role in shown if role is not None), None)
            if found is None:
                return PlainTextResponse(SIGN_IN, 401)
            role = found
        scope["role"] = role
        return None

    def _entry(self, scope: Scope, query: dict[str, list[str]], role: Role) -> Response:
        """Return what turns a link with a token into a cookie: the token is not to stay in the history."""
        rest = urlencode({name: values for name, values in query.items() if name != TOKEN}, doseq=True)
        path = "/" + scope["path"].lstrip("/\\")  # //elsewhere would lead there
        response = RedirectResponse(path + (f"?{rest}" if rest else ""), 303)
        secure = scope["scheme"] in ("https", "wss")
        response.set_cookie(
            self._cookie, self._access.cookie(role), httponly=True, samesite="strict", path="/", secure=secure
        )
        return response

    def _known(self, host: str) -> bool:
        """Say whether a Host header has a name of this studio in it."""
        if any(sign in host for sign in "@/?#"):
            return False
        try:
            name = (urlsplit(f"//{host}").hostname or "").rstrip(".")
            return name in self._hosts or bool(ipaddress.ip_address(name))
        except ValueError:
            return False


def _same(origin: str, host: str) -> bool:
    """Say whether an Origin is that of the page which is served at ``host``; "null" is nobody's."""
    scheme, _, rest = origin.partition("://")
    return scheme in ("http", "https") and rest.lower() == host.lower()


def _cookies(header: str, name: str) -> Iterator[str]:
    """Yield the values of a cookie. Not by ``http.cookies``: 15 kB of backslashes cost it 3 s, without any token."""
    for each in header.split(";"):
        found, _, value = each.strip().partition("=")
        if found == name:
            yield value


def _with_headers(send: Send) -> Send:
    """Return a ``send`` that puts our headers on each answer."""

    async def sent(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return sent
