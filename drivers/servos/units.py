"""Units of a control table: speeds, delays and baud rate codes."""

from collections.abc import Mapping
from math import pi
from types import MappingProxyType
from typing import Literal

from drivers.errors import BadRequest

RPM = 2 * pi / 60
"""One turn per minute in rad/s."""

RETURN_DELAY_STEP = 2e-6
"""Seconds per step of the return delay."""

Protocol = Literal[1, 2, "STS"]
"""Servo protocol: ROBOTIS' 1.0 or 2.0, or "STS" for Feetech's STS and SMS.

STS uses frames of protocol 1.0, another control table, and sync reads.
"""

Framing = Literal["own", "sdk"]
"""Packet code: our own, or that of ROBOTIS' ``dynamixel-sdk``."""

_RATE_TOLERANCE = 0.03
"""Relative difference of two baud rates that still communicate."""

# Protocol 1.0: 2 000 000 / (code + 1), named by the nearest usual rate; above 2 M for the MX only.
_NOMINAL_RATES = {16: 115_200, 34: 57_600, 103: 19_200, 207: 9600}
_MX_RATES = {250: 2_250_000, 251: 2_500_000, 252: 3_000_000}
_PROTOCOL_1 = {code: round(2_000_000 / (code + 1)) for code in range(255)} | _NOMINAL_RATES | _MX_RATES
_PROTOCOL_2 = dict(enumerate((9600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)))
_STS = dict(enumerate((1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)))

_RATES: Mapping[Protocol, Mapping[int, int]] = MappingProxyType(
    {1: MappingProxyType(_PROTOCOL_1), 2: MappingProxyType(_PROTOCOL_2), "STS": MappingProxyType(_STS)}
)


def protocol_label(protocol: Protocol) -> str:
    """Return the short name of a protocol for tables: ``1.0`` or ``STS``."""
    return protocol if protocol == "STS" else f"{protocol}.0"


def protocol_name(protocol: Protocol) -> str:
    """Return the name of a protocol for messages: ``protocol 1.0`` or ``the STS protocol``."""
    return "the STS protocol" if protocol == "STS" else f"protocol {protocol_label(protocol)}"


def baud_of(code: int, protocol: Protocol) -> int:
    """Return the baud rate of a code in register ``baud``. Raises BadRequest for an unknown code."""
    if code not in _RATES[protocol]:
        raise BadRequest(f"baud code {code} is unknown in {protocol_name(protocol)}", hint=_rates_hint(protocol))
    return _RATES[protocol][code]


def baud_code(baud: int, protocol: Protocol) -> int:
    """Return the code of the rate nearest to ``baud``. Raises BadRequest if none is within 3 %."""
    code = min(_RATES[protocol], key=lambda code: abs(_RATES[protocol][code] - baud))
    if not abs(_RATES[protocol][code] - baud) <= _RATE_TOLERANCE * baud:
        raise BadRequest(f"no servo of {protocol_name(protocol)} can run at {baud} baud", hint=_rates_hint(protocol))
    return code


def _rates_hint(protocol: Protocol) -> str:
    """Return a hint that lists the usual baud rates of a protocol."""
    usual = (9600, 19_200, 38_400, 57_600, 76_800, 115_200, 128_000, 200_000, 250_000, 400_000, 500_000)
    rates = sorted(rate for rate in _RATES[protocol].values() if rate in usual or rate >= 1_000_000)
    return f"rates are {', '.join(str(rate) for rate in rates)}"
