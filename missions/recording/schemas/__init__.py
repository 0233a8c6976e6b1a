"""What the messages of a record look like: a JSON schema (draft 2020-12) for each, as files beside this one."""

import json
from pathlib import Path

HERE = Path(__file__).parent


def schema(name: str) -> bytes:
    """Return the schema of that name, ``foxglove.Log`` or ``missiontree.Moment``, without blanks."""
    found = json.loads((HERE / f"{name}.json").read_bytes())
    return json.dumps(found, separators=(",", ":"), ensure_ascii=False).encode()
