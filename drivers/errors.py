"""Errors of devices, sorted by their remedy.

DriverError
|-- NotConnected   the port is absent, busy or gone: the driver reconnects, the mission waits
|   `-- SensorSilent   a sensor has not reported: nodes that depend on it are suspended
|-- NoReply        no reply, or an invalid one, after the retries
|-- DeviceFault    the device replies with a fault: overload, heat, voltage
`-- BadRequest     the request is impossible for the device
"""


class DriverError(Exception):
    """Base class: the message has the device, the failure and the value, ``hint`` the next command to type."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class NotConnected(DriverError, ConnectionError):
    """The port is absent, held by another program, not permitted, or gone."""


class SensorSilent(NotConnected):
    """A sensor has not reported recently: "the range finder does not report"."""


class NoReply(DriverError, TimeoutError):
    """A device on an open port did not reply in time, or replied with invalid data."""


class DeviceFault(DriverError, RuntimeError):
    """A device reports a fault of its own, such as an overload."""


class BadRequest(DriverError, ValueError):
    """The request has an unknown joint, a value that is not finite, or the like."""
