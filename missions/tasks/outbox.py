"""The notices that are to be delivered: each stays until its channel has taken it, however long that is away."""

import json
import sqlite3
from collections.abc import Collection
from dataclasses import dataclass

from missions.tasks.notice import Notice, notice_of

FIRST, LONGEST = 1.0, 600.0
"""Seconds to the second try, and from one try to the next at most; each is twice the one before."""

LONG = 7 * 24 * 3600.0
"""Seconds after which the server says that a notice is still not delivered."""


@dataclass(frozen=True, slots=True)
class Letter:
    """A notice for one channel; ``tries`` have failed, the last of them with ``last_error``. Times are Unix's."""

    id: int
    channel: str
    notice: Notice
    added: float
    tries: int
    delivered: float | None
    last_error: str


class Outbox:
    """The notices in a database of ``schema.open_db``; ``now`` is the wall clock, in seconds (Unix)."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def due(self, now: float, resting: Collection[str] = ()) -> Letter | None:
        """Return the notice that is to be tried first, of channels that do not rest; None where there is none.

        One whose next try is far ahead is due as well: the clock was put back since.
        """
        sql = (
            "SELECT * FROM outbox WHERE delivered IS NULL AND (next <= ?1 OR next > ?2) "
            "AND channel NOT IN (SELECT value FROM json_each(?3)) ORDER BY tries, id LIMIT 1"
        )
        row = self._connection.execute(sql, (now, now + LONGEST, json.dumps(list(resting)))).fetchone()
        return None if row is None else _letter(row)

    def delivered(self, letter: Letter, now: float) -> None:
        """Keep in mind that a channel has taken a notice."""
        self._connection.execute("UPDATE outbox SET delivered = ? WHERE id = ?", (now, letter.id))

    def failed(self, letter: Letter, error: str, now: float) -> None:
        """Keep in mind that a channel has not taken a notice, and why; it is tried again, later each time."""
        sql = "UPDATE outbox SET tries = tries + 1, last_error = ?, next = ? WHERE id = ?"
        self._connection.execute(sql, (error, now + delay(letter.tries + 1), letter.id))

    def of(self, task: int) -> list[Letter]:
        """Return all notices of a task, in order."""
        rows = self._connection.execute("SELECT * FROM outbox WHERE task = ? ORDER BY id", (task,))
        return [_letter(row) for row in rows]

    def waiting(self) -> int:
        """Return how many notices are not delivered yet."""
        (count,) = self._connection.execute("SELECT COUNT(*) FROM outbox WHERE delivered IS NULL").fetchone()
        return int(count)


def delay(failures: int) -> float:
    """Return the seconds to wait after so many tries that failed: 1, 2, 4 ... and 600 at most."""
    return min(LONGEST, FIRST * 2.0 ** min(failures - 1, 20))


def _letter(row: sqlite3.Row) -> Letter:
    return Letter(
        row["id"],
        row["channel"],
        notice_of(row["body"]),
        row["added"],
        row["tries"],
        row["delivered"],
        row["last_error"],
    )
