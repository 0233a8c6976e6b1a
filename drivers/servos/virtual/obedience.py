"""What a virtual STS makes of a write: it refuses nothing, and what it cannot do it leaves, or brings within bounds."""

from drivers.servos.virtual.memory import Memory

MIDDLE = 128
"""What ``torque_enable`` takes to make where the servo stands its middle."""


def obedient(memory: Memory, address: int, data: bytes) -> bytes:
    """Return what ``memory`` holds at ``address`` once ``data`` was written there; the maker is silent on the rest.

    Read-only registers stay, values come within their bounds, and a place that was made the middle moves the offset.
    """
    end = address + len(data)
    held = bytearray(memory.table[address:end].ljust(len(data), b"\0"))
    for row in memory.span(address, len(data)).rows:
        first = row.address - address
        if not row.writable or first < 0 or row.end > end:
            continue
        value = row.decode(data, address)
        if row.name == "torque_enable" and value == MIDDLE:
            offset = memory.get("position_offset") + memory.get("present_position") - memory.model.centre
            memory.set("position_offset", (offset + 2048) % 4096 - 2048 or 0)
            value = memory.get(row)
        held[first : first + row.size] = row.encode(min(max(value, row.lower), row.upper))
    return bytes(held)[: max(0, len(memory.table) - address)]
