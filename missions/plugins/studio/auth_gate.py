"""Authentication of each HTTP request and websocket of the studio, in front of all routing; denies by default.

It checks the Host header (against DNS rebinding), Origin (against cross-site requests, CSRF: any page may open a
websocket to anywhere), Sec-Fetch-Site (any page may request pictures), and an access token, or a cookie with a proof.
No CORS header permits other origins.
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
"""Query parameters. The proof is for the path; in a link to the page, for the websocket, and the script stores it."""

PAGE, SOCKET = "/", "/ws"

MEDIA_TYPES = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".html": "text/html"}
"""Media types of the files of the studio's page, by suffix. No files with other suffixes are served.

The cookie alone opens these files, without a proof, since they hold no secrets.
"""

CONTENT_POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""Content security policy of the studio's page: scripts, styles and connections of its own origin only; no frames."""

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
    "This is a MissionTree studio, and you are not signed in.\nOpen the link that `mission studio` printed.\n"
)


class AuthGate:
    """ASGI application that authenticates requests in front of ``app``; ``hosts`` are the host names allowed.

    Numeric addresses and `localhost` are always allowed: a foreign page cannot have such a name (DNS rebinding). The
    role of an authenticated request is stored in its scope, as ``role``.
    """

    def __init__(self, app: ASGIApp, access: StudioAccess, hosts: Collection[str]) -> None:
        self._app, self._access = app, access
        self._hosts = frozenset(host.lower() for host in hosts) | {"localhost"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass an authenticated request on to ``app``; answer all others with an error or a redirection."""
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
        """Return an error response if the request's address or headers are not allowed, else None."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._is_own_host(hosts[0]):
            return PlainTextResponse("not a host name of this studio: mission studio --name NAME\n", 403)
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            return PlainTextResponse("only GET\n", 405)
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin") and not _is_navigation(scope, headers):
            return PlainTextResponse("not allowed for pages of another site\n", 403)
        origins = headers.getlist("origin")
        if origins and not all(_is_same_origin(origin, hosts[0]) for origin in origins):
            return PlainTextResponse("not allowed for pages of another site\n", 403)
        if scope["type"] == "websocket" and not origins and "authorization" not in headers:
            return PlainTextResponse("a websocket needs an Origin, or a token in Authorization\n", 403)
        return None

    def _check_token(self, scope: Scope) -> Response | None:
        """Authenticate a request and write its role into ``scope``.

        Return an answer if the request is refused or redirected, else None.
        """
        headers = Headers(scope=scope)
        query = parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        kind, _, bearer = headers.get("authorization", "").partition(" ")
        token = bearer.strip() if kind.lower() == "bearer" else query.get(TOKEN, [""])[0]
        if not token:
            return self._check_cookie(scope, headers, query)
        address = network_of(scope["client"]) if scope.get("client") else ""
        role = self._access.by_token(token, address)
        if role is None:
            if self._access.has_many_wrong(address):
                return PlainTextResponse("too many wrong tokens: wait a minute\n", 429, {"Retry-After": "60"})
            return PlainTextResponse("wrong token\n", 403)
        if not bearer and scope["type"] == "http":
            return self._redirect_signed_in(scope, query, role)
        scope["role"] = role
        return None

    def _check_cookie(self, scope: Scope, headers: Headers, query: dict[str, list[str]]) -> Response | None:
        """Authenticate a request without a token by its cookie and its proof.

        Return an answer if the request is refused, else None.
        """
        path, proof = scope["path"], query.get(PROOF, [""])[0]
        sign_ins = self._sign_ins(headers)
        opened = SOCKET if path == PAGE else path
        proved = next((each for each in sign_ins if each.is_proved(opened, proof)), None)
        if not sign_ins:
            return PlainTextResponse(SIGN_IN_TEXT, 401)
        if path == PAGE and PROOF in query and proved is None:
            # The page stores the proof from its link: a link on another site must not replace it.
            return _redirect(scope, {name: each for name, each in query.items() if name != PROOF})
        if proved is not None:
            scope["role"], scope["sign_in"] = proved.role, proved
        elif scope["type"] != "http" or not _is_page_file(path):
            return PlainTextResponse(SIGN_IN_TEXT, 401)
        return None

    def _redirect_signed_in(self, scope: Scope, query: dict[str, list[str]], role: Role) -> Response:
        """Return a redirection to a link that has a proof instead of the token.

        So the token does not stay in the browser's history. If the browser has no sign-in of this role yet, the
        response also sets the cookie of one.
        """
        headers = Headers(scope=scope)
        value = ""
        sign_in = next((each for each in self._sign_ins(headers) if each.role == role), None)
        if sign_in is None:  # otherwise other tabs still use links with its proofs
            value, sign_in = self._access.sign_in(role)
        proof = sign_in.proof(SOCKET if scope["path"] == PAGE else scope["path"])
        rest = {name: values for name, values in query.items() if name != TOKEN}
        response = _redirect(scope, rest | {PROOF: [proof]})
        if value:
            secure = scope["scheme"] in ("https", "wss")
            # Not `strict`: the file of `--open` and a link in a mail count as other sites.
            name = _cookie_name(headers)
            response.set_cookie(name, value, httponly=True, samesite="lax", path="/", secure=secure)
        return response

    def _sign_ins(self, headers: Headers) -> list[SignIn]:
        """Return the sign-ins of the cookies that the browser sent, without cookies that the studio does not know."""
        values = _cookie_values(headers.get("cookie", ""), _cookie_name(headers))
        return [found for value in values if (found := self._access.by_cookie(value)) is not None]

    def _is_own_host(self, host: str) -> bool:
        """Return whether the name in a Host header is one of this studio."""
        if any(sign in host for sign in "@/?#"):
            return False
        try:
            found = urlsplit(f"//{host}")
            name, _ = (found.hostname or "").rstrip("."), found.port  # raises ValueError for an invalid port
            return name in self._hosts or bool(ipaddress.ip_address(name))
        except ValueError:
            return False


def link_to(path: str, sign_in: SignIn | None) -> str:
    """Return the link to ``path``, with its proof if there is a sign-in. Special characters are quoted."""
    proof = "" if sign_in is None else f"?{PROOF}={sign_in.proof(path)}"
    return quote(path, safe="/") + proof


def _is_page_file(path: str) -> bool:
    return path == PAGE or (path.rfind("/") == 0 and path.endswith(tuple(MEDIA_TYPES)))


def _is_navigation(scope: Scope, headers: Headers) -> bool:
    """Return whether a browser opens the page in a tab, instead of fetching or framing it for another page."""
    mode_and_dest = headers.get("sec-fetch-mode"), headers.get("sec-fetch-dest")
    return scope["type"] == "http" and scope["path"] == PAGE and mode_and_dest == ("navigate", "document")


def _redirect(scope: Scope, query: dict[str, list[str]]) -> Response:
    """Return a redirection to the same path with another query."""
    path = "/" + quote(scope["path"].lstrip("/\\"))  # "//host" would redirect to another host
    return RedirectResponse(path + (f"?{urlencode(query, doseq=True)}" if query else ""), 303)


def _is_same_origin(origin: str, host: str) -> bool:
    """Return whether an Origin header is that of the page served at ``host``; "null" never is."""
    scheme, _, rest = origin.partition("://")
    return scheme in ("http", "https") and rest.lower() == host.lower()


def _cookie_name(headers: Headers) -> str:
    """Return the cookie's name, which includes the port: several studios may share one host name."""
    return f"missiontree_{urlsplit('//' + headers['host']).port or ''}"


def _cookie_values(header: str, name: str) -> Iterator[str]:
    """Yield the values of a cookie.

    It does not use ``http.cookies``, which takes 3 s for a header with 15 kB of backslashes.
    """
    for each in header.split(";"):
        found, _, value = each.strip().partition("=")
        if found == name:
            yield value


def _add_headers(send: Send, more: Mapping[str, str]) -> Send:
    """Return a function in place of ``send`` that adds the headers ``more`` to each response."""

    async def sent(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            headers = MutableHeaders(scope=message)
            for name, value in more.items():
                headers.setdefault(name, value)
        await send(message)

    return sent
