"""Access control of the studio: two tokens, the sign-ins of browsers, and a limit on wrong tokens (brute force)."""

import hashlib
import hmac
import json
import os
import secrets
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from config.file_io import parse_object, read_regular_text
from drivers.clock import Clock, SystemClock
from missions.control.commands import Role
from missions.library.folders import state_folder

# Tokens that the user stores beyond one studio: a file that only its owner can read.

ROLE_NAMES = ("operator", "viewer")
MIN_TOKEN_LENGTH = 24
"""Minimum length of a token in characters: 18 random bytes in base64 have this length."""


def token_file() -> Path:
    """Return the path of the file that stores the studio's operator and viewer tokens."""
    return state_folder() / "studio.tokens"


def load_tokens(path: Path | None = None) -> tuple[str, str]:
    """Return the stored operator and viewer tokens; if there are none, create and store new ones. Raises OSError."""
    path = token_file() if path is None else path
    with suppress(FileNotFoundError, ValueError, TypeError, KeyError):
        found = parse_object(read_regular_text(path))
        operator, viewer = (str(found[name]) for name in ROLE_NAMES)
        if min(len(operator), len(viewer)) >= MIN_TOKEN_LENGTH and path.stat().st_mode & 0o077 == 0:
            return operator, viewer
    operator, viewer = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
    save_tokens(operator, viewer, path)
    return operator, viewer


def save_tokens(operator: str, viewer: str, path: Path | None = None) -> None:
    """Store the tokens for the next start of the studio, replacing the stored ones. Raises OSError."""
    path = token_file() if path is None else path
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with open(number, "w", encoding="ascii") as file:  # noqa: PTH123 - of a descriptor
        json.dump({"operator": operator, "viewer": viewer}, file)


MAX_WRONG_TOKENS, WRONG_TOKEN_WINDOW = 10, 60.0
"""Wrong tokens of one address, within seconds, from which more are refused. A valid token is always accepted."""

MAX_SIGN_INS, MAX_ADDRESSES = 500, 1000
"""Maximum number of sign-ins of each role, and of recorded addresses; the oldest are dropped."""

ONCE_TOKEN_LIFETIME = 120.0
"""Seconds for which a one-time token is valid, with which the studio opens its page in this computer's browser."""


@dataclass(frozen=True, slots=True)
class SignIn:
    """Sign-in of a browser: its role, and the secret from which the studio computes the proof for each path.

    A proof is a query parameter of a link and is valid for one path only. It is needed since a browser sends its cookie
    to every server on the same host name, whatever the port. So the cookie alone opens only the page's files. Any other
    path also needs its proof, which the browser stores for this page alone. The ``secret`` never leaves the studio.
    """

    role: Role
    secret: bytes = field(default_factory=lambda: secrets.token_bytes(32), repr=False)

    def proof(self, path: str) -> str:
        """Return the proof for ``path``: a text that only this sign-in can compute, and that opens no other path."""
        return hmac.digest(self.secret, path.encode("utf-8", "replace"), "sha256").hex()

    def is_proved(self, path: str, proof: str) -> bool:
        """Return whether ``proof`` is the proof for ``path``."""
        return hmac.compare_digest(self.proof(path).encode(), proof.encode("utf-8", "replace"))


@dataclass(slots=True)
class StudioAccess:
    """Tokens and sign-ins of a studio. All sign-ins end with the studio's process, and when the tokens are renewed.

    ``save`` stores new tokens in a file for the next start of a studio, or is None; ``epoch`` counts the renewals.
    """

    operator: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    viewer: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    clock: Clock = field(default_factory=SystemClock)
    save: Callable[[str, str], None] | None = None
    epoch: int = 0
    _once_digest: bytes = b""
    _once_until: float = 0.0
    _sign_ins: dict[bytes, SignIn] = field(default_factory=dict)
    _wrong_times: dict[str, deque[float]] = field(default_factory=dict)

    def by_token(self, token: str, address: str) -> Role | None:
        """Return the role of a token, or None for a wrong token, which is counted for the client's ``address``."""
        if self._once_digest and hmac.compare_digest(_digest(token), self._once_digest):
            self._once_digest = b""
            if self.clock.now() < self._once_until:
                return "operator"
        role: Role | None = None
        for known, whose in ((self.viewer, "viewer"), (self.operator, "operator")):
            if hmac.compare_digest(
                token.encode("utf-8", "replace"), known.encode()
            ):  # compares all, so that the time is constant
                role = "operator" if whose == "operator" else "viewer"
        if role is None:
            self._count_wrong(address)
        return role

    def make_once_token(self) -> str:
        """Return a new token that signs in one operator, once, within ``ONCE_TOKEN_LIFETIME``."""
        token = secrets.token_urlsafe(24)
        self._once_digest, self._once_until = _digest(token), self.clock.now() + ONCE_TOKEN_LIFETIME
        return token

    @property
    def is_once_open(self) -> bool:
        """Whether there is a one-time token that has not been used."""
        return bool(self._once_digest)

    def renew(self) -> None:
        """Replace the tokens of operator and viewer, and end all sign-ins.

        Raises OSError if the tokens cannot be stored.
        """
        self.operator, self.viewer = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
        self._once_digest, self.epoch = b"", self.epoch + 1
        self._sign_ins.clear()
        if self.save is not None:
            self.save(self.operator, self.viewer)

    def has_many_wrong(self, address: str) -> bool:
        """Return whether an address has sent too many wrong tokens within ``WRONG_TOKEN_WINDOW``."""
        tries = self._wrong_times.get(address)
        now = self.clock.now()
        while tries and now - tries[0] > WRONG_TOKEN_WINDOW:
            tries.popleft()
        return tries is not None and len(tries) >= MAX_WRONG_TOKENS

    def sign_in(self, role: Role) -> tuple[str, SignIn]:
        """Create a sign-in of a role; return its cookie value and the sign-in.

        If the role then has more than ``MAX_SIGN_INS`` sign-ins, the oldest one ends.
        """
        value, found = secrets.token_urlsafe(24), SignIn(role)
        same = [digest for digest, each in self._sign_ins.items() if each.role == role]
        for digest in same[: max(0, len(same) + 1 - MAX_SIGN_INS)]:
            del self._sign_ins[digest]
        self._sign_ins[_digest(value)] = found
        return value, found

    def by_cookie(self, value: str) -> SignIn | None:
        """Return the sign-in of a cookie value, or None. The lookup by digest prevents timing attacks."""
        return self._sign_ins.get(_digest(value))

    def _count_wrong(self, address: str) -> None:
        while len(self._wrong_times) >= MAX_ADDRESSES and address not in self._wrong_times:
            del self._wrong_times[next(iter(self._wrong_times))]
        self._wrong_times.setdefault(address, deque(maxlen=MAX_WRONG_TOKENS)).append(self.clock.now())


def _digest(value: str) -> bytes:
    return hashlib.sha256(value.encode("utf-8", "replace")).digest()
