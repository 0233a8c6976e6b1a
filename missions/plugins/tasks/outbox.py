"""The outbox: notices that wait until their channel accepts them or they are given up."""

import json
import sqlite3
from collections.abc import Collection
from dataclasses import dataclass, replace
from math import inf

from config.notices import public_text
from missions.plugins.tasks.notice import Notice, from_row

WAITING = "delivered IS NULL AND next < 9e999"
"""SQL condition of notices that are neither delivered nor given up.

The column ``next`` is the earliest time of the next try; it is infinite for a notice that was given up.
"""


@dataclass(frozen=True, slots=True)
class QueuedNotice:
    """A notice for one channel, with ``tries`` failed tries and the ``last_error``. Times are Unix times.

    A notice that is ``given_up`` is not tried again.
    """

    id: int
    channel: str
    notice: Notice
    added: float
    tries: int
    delivered: float | None
    last_error: str
    given_up: bool


class Outbox:
    """Notices in a database of ``queue_database.open_db``; ``now`` is Unix time in seconds."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def channels(self) -> list[str]:
        """Return the channels, as encoded text, that have waiting notices."""
        rows = self._connection.execute(f"SELECT DISTINCT channel FROM outbox WHERE {WAITING}")  # noqa: S608 - ours
        return [row["channel"] for row in rows]

    def first(self, channel: str, excluded: Collection[int] = (), *, fresh: bool = False) -> QueuedNotice | None:
        """Return the oldest waiting notice of a ``channel`` whose ID is not ``excluded``.

        With ``fresh``, notices with fewer tries come first.
        """
        sql = (
            f"SELECT * FROM outbox WHERE {WAITING} AND channel = ? "  # noqa: S608 - ours
            f"AND id NOT IN (SELECT value FROM json_each(?)) ORDER BY {'tries, id' if fresh else 'id'} LIMIT 1"
        )
        row = self._connection.execute(sql, (channel, json.dumps(list(excluded)))).fetchone()
        return None if row is None else _queued_notice(row)

    def mark_delivered(self, letter: QueuedNotice, now: float) -> None:
        """Store that the notice ``letter`` was delivered."""
        self._connection.execute("UPDATE outbox SET delivered = ? WHERE id = ?", (now, letter.id))

    def mark_failed(self, letter: QueuedNotice, error: str) -> None:
        """Store a failed try to deliver the notice ``letter``, with its error."""
        self._connection.execute("UPDATE outbox SET tries = tries + 1, last_error = ? WHERE id = ?", (error, letter.id))

    def give_up(self, channel: str, before: float) -> int:
        """Give up the waiting notices of a channel that are older than ``before``; return their number."""
        sql = f"UPDATE outbox SET next = ? WHERE {WAITING} AND channel = ? AND added < ?"  # noqa: S608 - ours
        return self._connection.execute(sql, (inf, channel, before)).rowcount

    def notices_of(self, task: int) -> list[QueuedNotice]:
        """Return all notices of a task in the order of their creation, with channel names that contain no secrets."""
        rows = self._connection.execute("SELECT * FROM outbox WHERE task = ? ORDER BY id", (task,))
        return [replace(_queued_notice(row), channel=public_text(row["channel"])) for row in rows]

    def pending_count(self) -> int:
        """Return the number of waiting notices."""
        (count,) = self._connection.execute(f"SELECT COUNT(*) FROM outbox WHERE {WAITING}").fetchone()  # noqa: S608
        return int(count)


def _queued_notice(row: sqlite3.Row) -> QueuedNotice:
    return from_row(QueuedNotice, row, notice=row["body"], given_up=row["next"] == inf)
