"""The one door of the studio: nothing gets by that has not shown a token, whether over HTTP or a websocket.

It stands before all routing and denies by default. It looks at the Host (a page from elsewhere whose name was pointed
at this computer asks for that name), at the Origin (browsers let any page open a websocket to anywhere), at
Sec-Fetch-Site (they let any page ask for pictures), and at a token, or a cookie with a proof.
"""

import ipaddress
from collections.abc import Collection, Iterator, Mapping
from urllib.parse import parse_qs, quote, urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from missions.control.commands import Role
from missions.plugins.studio.access import SignIn, StudioAccess
from missions.plugins.studio.connections import AuthLevel, ClientConnection, network_of

TOKEN, PROOF = "token", "proof"
"""Members of a query. The proof is that of the path; that of the websocket for the page, whose script keeps it."""

PAGE, SOCKET = "/", "/ws"

MEDIA_TYPES = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".html": "text/html"}
"""Types of the files of the page, and no others. A cookie opens them by itself: every installation has the same."""

CONTENT_POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""What a page may do: run, look and ask as it was served here, and nothing else; nobody frames it."""

HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": CONTENT_POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
}

SIGN_IN_TEXT = (
    "This is a studio of MissionTree, and you are not signed in.\nOpen the link that `mission studio` has printed.\n"
)


class AuthGate:
    """An ASGI application in front of ``app``. ``hosts`` are the names by which the studio may be asked for.

    Addresses in figures are always good, as are ``localhost`` and its like: no other page has such a name. Who gets by
    has a ``role`` in the scope.
    """

    def __init__(self, app: ASGIApp, access: StudioAccess, hosts: Collection[str]) -> None:
        self._app, self._access = app, access
        self._hosts = frozenset(host.lower() for host in hosts) | {"localhost"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request by, or answer it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] not in ("http", "websocket"):
            return
        refusal = self._refusal(scope) or self._check_token(scope)
        if refusal is None:
            visit: ClientConnection = scope["state"]["visit"]
            visit.auth_level = max(visit.auth_level, AuthLevel.SIGNED_IN if "role" in scope else AuthLevel.VISITOR)
            await self._app(scope, receive, _add_headers(send, HEADERS))
        else:
            await refusal(scope, receive, _add_headers(send, {**HEADERS, "Connection": "close"}))

    def _refusal(self, scope: Scope) -> Response | None:
        """Return why nobody is to be answered who asks so."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._is_own_host(hosts[0]):
            return PlainTextResponse("not the name of this studio: mission studio --name NAME\n", 403)
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            return PlainTextResponse("only GET\n", 405)
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin") and not _is_navigation(scope, headers):
            return PlainTextResponse("a page from elsewhere may not do this\n", 403)
        origins = headers.getlist("origin")
        if origins and not all(_is_same_origin(origin, hosts[0]) for origin in origins):
            return PlainTextResponse("a page from elsewhere may not do this\n", 403)
        if scope["type"] == "websocket" and not origins and "authorization" not in headers:
            return PlainTextResponse("a websocket needs an Origin, or a token in Authorization\n", 403)
        return None

    def _check_token(self, scope: Scope) -> Response | None:
        """Note in ``scope`` who asks; return the answer for who has not signed in, or signs in now."""
        headers = Headers(scope=scope)
        query = parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        kind, _, bearer = headers.get("authorization", "").partition(" ")
        given = bearer.strip() if kind.lower() == "bearer" else query.get(TOKEN, [""])[0]
        if not given:
            return self._check_cookie(scope, headers, query)
        address = network_of(scope["client"]) if scope.get("client") else ""
        role = self._access.by_token(given, address)
        if role is None:
            if self._access.has_many_wrong(address):
                return PlainTextResponse("too many wrong tokens: wait a minute\n", 429, {"Retry-After": "60"})
            return PlainTextResponse("a wrong token\n", 403)
        if not bearer and scope["type"] == "http":
            return self._redirect_signed_in(scope, query, role)
        scope["role"] = role
        return None

    def _check_cookie(self, scope: Scope, headers: Headers, query: dict[str, list[str]]) -> Response | None:
        """Do the same for a request that shows no token."""
        path, proof = scope["path"], query.get(PROOF, [""])[0]
        sign_ins = self._sign_ins(headers)
        opened = SOCKET if path == PAGE else path
        proved = next((each for each in sign_ins if each.is_proved(opened, proof)), None)
        if not sign_ins:
            return PlainTextResponse(SIGN_IN_TEXT, 401)
        if path == PAGE and PROOF in query and proved is None:
            # The script of the page keeps the proof that it is opened with: a link elsewhere may not give it another.
            return _redirect(scope, {name: each for name, each in query.items() if name != PROOF})
        if proved is not None:
            scope["role"], scope["sign_in"] = proved.role, proved
        elif scope["type"] != "http" or not _is_page_file(path):
            return PlainTextResponse(SIGN_IN_TEXT, 401)
        return None

    def _redirect_signed_in(self, scope: Scope, query: dict[str, list[str]], role: Role) -> Response:
        """Return the answer that turns a link with a token into a cookie and a proof: no token stays in the history."""
        headers = Headers(scope=scope)
        value = ""
        sign_in = next((each for each in self._sign_ins(headers) if each.role == role), None)
        if sign_in is None:  # else other tabs of this browser have links that are proved by it
            value, sign_in = self._access.sign_in(role)
        proof = sign_in.proof(SOCKET if scope["path"] == PAGE else scope["path"])
        rest = {name: values for name, values in query.items() if name != TOKEN}
        response = _redirect(scope, rest | {PROOF: [proof]})
        if value:
            secure = scope["scheme"] in ("https", "wss")
            # Not `strict`: the page that `--open` starts with, and a link in a mail, are other sites to a browser.
            name = _cookie_name(headers)
            response.set_cookie(name, value, httponly=True, samesite="lax", path="/", secure=secure)
        return response

    def _sign_ins(self, headers: Headers) -> list[SignIn]:
        """Return the sign-ins whose cookies a browser has sent; a server on another port may have added others."""
        values = _cookie_values(headers.get("cookie", ""), _cookie_name(headers))
        return [found for value in values if (found := self._access.by_cookie(value)) is not None]

    def _is_own_host(self, host: str) -> bool:
        """Say whether a Host header has a name of this studio in it."""
        if any(sign in host for sign in "@/?#"):
            return False
        try:
            found = urlsplit(f"//{host}")
            name, _ = (found.hostname or "").rstrip("."), found.port  # which raises ValueError for what is none
            return name in self._hosts or bool(ipaddress.ip_address(name))
        except ValueError:
            return False


def link_to(path: str, sign_in: SignIn | None) -> str:
    """Return the link by which a page opens ``path``, whatever characters are in it: a browser sends no token."""
    proof = "" if sign_in is None else f"?{PROOF}={sign_in.proof(path)}"
    return quote(path, safe="/") + proof


def _is_page_file(path: str) -> bool:
    return path == PAGE or (path.rfind("/") == 0 and path.endswith(tuple(MEDIA_TYPES)))


def _is_navigation(scope: Scope, headers: Headers) -> bool:
    """Return whether a browser opens the page in a tab, and does not fetch or frame it for another one."""
    asked = headers.get("sec-fetch-mode"), headers.get("sec-fetch-dest")
    return scope["type"] == "http" and scope["path"] == PAGE and asked == ("navigate", "document")


def _redirect(scope: Scope, query: dict[str, list[str]]) -> Response:
    """Return a redirection to the same path with another query."""
    path = "/" + quote(scope["path"].lstrip("/\\"))  # //elsewhere would lead there
    return RedirectResponse(path + (f"?{urlencode(query, doseq=True)}" if query else ""), 303)


def _is_same_origin(origin: str, host: str) -> bool:
    """Say whether an Origin is that of the page which is served at ``host``; "null" is nobody's."""
    scheme, _, rest = origin.partition("://")
    return scheme in ("http", "https") and rest.lower() == host.lower()


def _cookie_name(headers: Headers) -> str:
    """Return the name of the cookie: of one host name, each port has its own studio, also behind a tunnel."""
    return f"missiontree_{urlsplit('//' + headers['host']).port or ''}"


def _cookie_values(header: str, name: str) -> Iterator[str]:
    """Yield the values of a cookie. Not by ``http.cookies``: 15 kB of backslashes cost it 3 s, without any token."""
    for each in header.split(";"):
        found, _, value = each.strip().partition("=")
        if found == name:
            yield value


def _add_headers(send: Send, more: Mapping[str, str]) -> Send:
    """Return a ``send`` that puts our headers on each answer."""

    async def sent(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            headers = MutableHeaders(scope=message)
            for name, value in more.items():
                headers.setdefault(name, value)
        await send(message)

    return sent
