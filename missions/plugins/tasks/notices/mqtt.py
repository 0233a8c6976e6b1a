"""Notice channel: a topic of an MQTT broker, by paho-mqtt (extra: `pip install 'missiontree[mqtt]'`)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from config.notices import MqttNotice
from drivers.clock import Clock, SystemClock
from missions.plugins.tasks.notice import DeliveryError, Notice, read_secret

if TYPE_CHECKING:
    from paho.mqtt.client import Client
    from paho.mqtt.reasoncodes import ReasonCode

TIMEOUT = 10.0
"""Seconds to connect to the broker, and the same time again to wait for its acknowledgement."""

POLL_INTERVAL = 0.1
"""Seconds for which one iteration of the network loop waits for traffic."""


class MqttChannel:
    """Publishes each notice with QoS 1 over a new connection, and waits for the broker's acknowledgement.

    QoS 1 is at-least-once delivery; the JSON has the notice's ``id``. Messages are not retained, and have no last will.
    """

    def __init__(
        self,
        config: MqttNotice,
        environment: Mapping[str, str],
        timeout: float = TIMEOUT,
        clock: Clock | None = None,
    ) -> None:
        self._config, self._environment, self._timeout = config, environment, timeout
        self._clock = SystemClock() if clock is None else clock

    def __call__(self, notice: Notice) -> None:
        """Publish a notice. Raises DeliveryError if the broker is offline, refuses, or does not acknowledge in time."""
        client, delivery = self._client(), _Delivery()
        client.on_connect, client.on_disconnect = delivery.on_connect, delivery.on_disconnect
        client.on_publish = delivery.on_publish
        where = f"mqtt {self._config.host}:{self._config.port}"
        try:
            client.connect(self._config.host, self._config.port)
            client.publish(self._config.topic, notice.as_json().encode(), qos=1)
            problem = self._wait(client, delivery)
        except (OSError, ValueError) as error:
            problem = str(error) or type(error).__name__
        finally:
            client.disconnect()
        if problem:
            raise DeliveryError(f"{where}: {problem}")

    def _client(self) -> "Client":
        try:
            from paho.mqtt.client import Client  # noqa: PLC0415 - an extra
            from paho.mqtt.enums import CallbackAPIVersion  # noqa: PLC0415
        except ImportError as error:
            raise DeliveryError("MQTT needs paho-mqtt: pip install 'missiontree[mqtt]'") from error
        client, config = Client(CallbackAPIVersion.VERSION2), self._config
        client.connect_timeout = self._timeout
        if config.tls:
            client.tls_set()
        if config.user:
            client.username_pw_set(
                config.user, read_secret(config.password, self._environment) if config.password else None
            )
        return client

    def _wait(self, client: "Client", delivery: "_Delivery") -> str:
        """Run the network loop until the notice is acknowledged; return the error if it is not."""
        until = self._clock.now() + self._timeout
        while not (delivery.is_acknowledged or delivery.problem):
            code = client.loop(POLL_INTERVAL)
            if code:  # usually a callback has reported the details
                delivery.fail(f"the connection broke: {code.name}")
            elif self._clock.now() > until:
                delivery.fail(f"the broker did not acknowledge within {self._timeout:g} s")
        return "" if delivery.is_acknowledged else delivery.problem


class _Delivery:
    """paho callbacks for one notice: ``is_acknowledged``, and the first ``problem``."""

    def __init__(self) -> None:
        self.is_acknowledged = False
        self.problem = ""

    def fail(self, problem: str) -> None:
        self.problem = self.problem or problem

    def on_connect(self, _client: object, _data: object, _flags: object, reason: "ReasonCode", _more: object) -> None:
        if reason.is_failure:
            self.fail(f"the broker refuses: {reason}")

    def on_disconnect(
        self, _client: object, _data: object, _flags: object, reason: "ReasonCode", _more: object
    ) -> None:
        self.fail(f"the broker disconnected: {reason}")

    def on_publish(self, _client: object, _data: object, _id: int, reason: "ReasonCode", _more: object) -> None:
        if reason.is_failure:
            self.fail(f"the broker refuses the notice: {reason}")
        else:
            self.is_acknowledged = True
