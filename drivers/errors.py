"""What can go wrong with a device, sorted by what helps.

::

    DriverError
    |-- NotConnected   the port is absent, busy or gone: the driver reconnects, the mission waits
    |   `-- SensorSilent   a sensor has not reported: what depends on it is suspended
    |-- NoReply        nothing, or nonsense, came back after the retries
    |-- DeviceFault    the device works but complains: overload, heat, voltage
    `-- BadRequest     the caller asked for what the device cannot do
"""


class DriverError(Exception):
    """The root: who, what happened and the value seen in the message; what to type next in ``hint``."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class NotConnected(DriverError, ConnectionError):
    """The port is absent, held by someone else, not permitted, or has gone away."""


class SensorSilent(NotConnected):
    """A sensor has not reported lately: "the range finder does not report"."""


class NoReply(DriverError, TimeoutError):
    """A device on an open port did not answer in time, or answered with something that fails its checks."""


class DeviceFault(DriverError, RuntimeError):
    """A device answers and reports a fault of its own, such as an overload."""


class BadRequest(DriverError, ValueError):
    """The request names a joint that is not there, or a value that is not finite."""
