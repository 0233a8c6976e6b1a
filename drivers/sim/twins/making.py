"""From the keys of a robot file to twins, each on a stage."""

from drivers.api.sections import BaseKeys
from drivers.base.arbitrated import settings_of
from drivers.base.plain_twin import PlainTwin
from drivers.base.reckoning import TwoWheels
from drivers.base.twin import BaseTwin
from drivers.pi_car.declared import PiCarKeys
from drivers.sim.stage import Stage
from drivers.waveshare.declared import WaveshareKeys
from drivers.waveshare.wire import FASTEST


def base(keys: BaseKeys, stage: Stage) -> BaseTwin:
    """Return the twin of a base on two wheels, of whatever make."""
    return BaseTwin(
        stage.clock,
        **settings_of(keys, stage),
        body=stage.body(),
        gyro_noise=stage.physics.gyro_noise,
        dropouts=stage.physics.dropouts,
        seed=stage.seed,
        capabilities=keys.capabilities,
    )


def waveshare(keys: WaveshareKeys, stage: Stage) -> PlainTwin:
    """Return the twin of a rover of Waveshare's."""
    wheels = TwoWheels(keys.track, FASTEST if keys.encoders else keys.speed_at_full)
    return plain(wheels, keys, stage, reckoned=not keys.encoders)


def pi_car(keys: PiCarKeys, stage: Stage) -> PlainTwin:
    """Return the twin of a car of a Raspberry Pi."""
    return plain(TwoWheels(keys.track, keys.speed_at_full), keys, stage, reckoned=True, gauge=False)


def plain(
    wheels: TwoWheels, keys: BaseKeys, stage: Stage, *, reckoned: bool, gauge: bool = True, gyro: bool = False
) -> PlainTwin:
    """Return the twin of a base that feels nothing: with a pose that is dead reckoning, without a ``gauge`` perhaps."""
    return PlainTwin(
        stage.clock,
        wheels=wheels,
        reckoned=reckoned,
        gauge=gauge,
        gyro=gyro,
        body=stage.body(),
        dropouts=stage.physics.dropouts,
        seed=stage.seed,
        **settings_of(keys, stage),
    )
