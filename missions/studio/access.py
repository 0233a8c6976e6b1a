"""Who may use the studio: two tokens, the cookies that are given for them, and how often a wrong one is tried."""

import hashlib
import hmac
import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.clock import Clock, SystemClock
from missions.studio.commands import Role

TRIES, WINDOW = 10, 60.0
"""So many wrong tokens may come from an address within so many seconds; then none is looked at for as long."""

MOST_COOKIES, MOST_ADDRESSES = 1000, 1000
"""Cookies that hold at once, and addresses that are kept in mind; the oldest go."""


@dataclass(slots=True)
class Access:
    """Knows tokens and cookies by their digests, for as long as the process lives, or until they are made anew.

    ``keep`` writes new tokens where they outlive the studio; ``epoch`` counts how often they were made anew.
    """

    operator: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    viewer: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    clock: Clock = field(default_factory=SystemClock)
    keep: Callable[[str, str], None] | None = None
    epoch: int = 0
    _once: bytes = b""
    _cookies: dict[bytes, Role] = field(default_factory=dict)
    _wrong: dict[str, deque[float]] = field(default_factory=dict)

    def by_token(self, token: str, address: str) -> Role | None:
        """Return whose token this is; None for nobody's, and while too many wrong ones come from ``address``."""
        if self.shut(address):
            return None
        if self._once and hmac.compare_digest(_digest(token), self._once):
            self._once = b""
            return "operator"
        role: Role | None = None
        for known, whose in ((self.viewer, "viewer"), (self.operator, "operator")):
            if hmac.compare_digest(token.encode("utf-8", "replace"), known.encode()):  # each, whichever it is
                role = "operator" if whose == "operator" else "viewer"
        if role is None:
            self._note(address)
        return role

    def once(self) -> str:
        """Return a token that lets an operator in once: for a command line, which every user of this computer sees."""
        token = secrets.token_urlsafe(24)
        self._once = _digest(token)
        return token

    def renew(self) -> None:
        """Make both tokens anew; no former one, and no cookie, lets anybody in. Raises OSError where none is kept."""
        self.operator, self.viewer = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
        self._once, self.epoch = b"", self.epoch + 1
        self._cookies.clear()
        if self.keep is not None:
            self.keep(self.operator, self.viewer)

    def shut(self, address: str) -> bool:
        """Say whether too many wrong tokens came from an address lately."""
        tries = self._wrong.get(address)
        now = self.clock.now()
        while tries and now - tries[0] > WINDOW:
            tries.popleft()
        return tries is not None and len(tries) >= TRIES

    def cookie(self, role: Role) -> str:
        """Return a new cookie for who has shown a token."""
        value = secrets.token_urlsafe(24)
        while len(self._cookies) >= MOST_COOKIES:
            del self._cookies[next(iter(self._cookies))]
        self._cookies[_digest(value)] = role
        return value

    def by_cookie(self, value: str) -> Role | None:
        """Return whose cookie this is; found by its digest, so that no time tells how much of it is right."""
        return self._cookies.get(_digest(value))

    def _note(self, address: str) -> None:
        while len(self._wrong) >= MOST_ADDRESSES and address not in self._wrong:
            del self._wrong[next(iter(self._wrong))]
        self._wrong.setdefault(address, deque(maxlen=TRIES)).append(self.clock.now())


def _digest(value: str) -> bytes:
    return hashlib.sha256(value.encode("utf-8", "replace")).digest()
