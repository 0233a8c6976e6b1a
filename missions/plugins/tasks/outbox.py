"""The notices that are to be delivered: each stays until its channel has taken it, or it is given up."""

import json
import sqlite3
from collections.abc import Collection
from dataclasses import dataclass, replace
from math import inf

from config.notices import public_text
from missions.plugins.tasks.notice import Notice, from_row

WAITING = "delivered IS NULL AND next < 9e999"
"""What is still to be delivered: ``next``, the time from which on it may be tried, is infinite for what is given up."""


@dataclass(frozen=True, slots=True)
class QueuedNotice:
    """A notice for one channel; ``tries`` have failed, the last of them with ``last_error``. Times are Unix's.

    One that is ``given_up`` is not tried any more.
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
    """The notices in a database of ``schema.open_db``; ``now`` is the wall clock, in seconds (Unix)."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def channels(self) -> list[str]:
        """Return the channels for which notices wait."""
        rows = self._connection.execute(f"SELECT DISTINCT channel FROM outbox WHERE {WAITING}")  # noqa: S608 - ours
        return [row["channel"] for row in rows]

    def first(self, channel: str, excluded: Collection[int] = (), *, fresh: bool = False) -> QueuedNotice | None:
        """Return what is to be delivered next to a ``channel``, in the order in which things happened.

        ``besides`` are the ids of those that are not meant; with ``fresh``, those that were tried less come first.
        """
        sql = (
            f"SELECT * FROM outbox WHERE {WAITING} AND channel = ? "  # noqa: S608 - ours
            f"AND id NOT IN (SELECT value FROM json_each(?)) ORDER BY {'tries, id' if fresh else 'id'} LIMIT 1"
        )
        row = self._connection.execute(sql, (channel, json.dumps(list(excluded)))).fetchone()
        return None if row is None else _queued_notice(row)

    def mark_delivered(self, letter: QueuedNotice, now: float) -> None:
        """Keep in mind that a channel has taken a notice."""
        self._connection.execute("UPDATE outbox SET delivered = ? WHERE id = ?", (now, letter.id))

    def mark_failed(self, letter: QueuedNotice, error: str) -> None:
        """Keep in mind that a channel has not taken a notice, and why."""
        self._connection.execute("UPDATE outbox SET tries = tries + 1, last_error = ? WHERE id = ?", (error, letter.id))

    def give_up(self, channel: str, before: float) -> int:
        """Give up what waits for a channel since ``before``; return how many notices that were."""
        sql = f"UPDATE outbox SET next = ? WHERE {WAITING} AND channel = ? AND added < ?"  # noqa: S608 - ours
        return self._connection.execute(sql, (inf, channel, before)).rowcount

    def notices_of(self, task: int) -> list[QueuedNotice]:
        """Return all notices of a task, in order, for people: their channels are named without secrets."""
        rows = self._connection.execute("SELECT * FROM outbox WHERE task = ? ORDER BY id", (task,))
        return [replace(_queued_notice(row), channel=public_text(row["channel"])) for row in rows]

    def pending_count(self) -> int:
        """Return how many notices are still to be delivered."""
        (count,) = self._connection.execute(f"SELECT COUNT(*) FROM outbox WHERE {WAITING}").fetchone()  # noqa: S608
        return int(count)


def _queued_notice(row: sqlite3.Row) -> QueuedNotice:
    return from_row(QueuedNotice, row, notice=row["body"], given_up=row["next"] == inf)
