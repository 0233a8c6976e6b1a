"""Names of Feetech servos by model number: the series in the low byte, the model in the high byte.

Source: the model list of the maker's debug software, FD. A series is SCS (5), SMS with a brushless motor (8), or STS
(9). Programs that read SCS numbers as big-endian, such as LeRobot, swap their bytes.
"""

from collections.abc import Mapping
from types import MappingProxyType


def _by_model_number(series: int, models: Mapping[int, str]) -> dict[int, str]:
    return {model << 8 | series: name for model, name in models.items()}


NAMES: Mapping[int, str] = MappingProxyType(
    {
        **_by_model_number(
            8,
            {
                24: "SM24BL",
                25: "SM29BL",
                29: "SM29BL",
                30: "SM30BL",
                40: "SM40BL",
                42: "SM45BL",
                44: "SM8512BL",
                120: "SM120BL",
            },
        ),
        **_by_model_number(
            9,
            {
                1: "STS3015",
                2: "STS3032",
                3: "STS3215",
                4: "STS3040",
                5: "STS3020",
                6: "STS3046",
                7: "STS3045",
                8: "STS3235",
                9: "STS3095",
                10: "STS3095",
                11: "STS3250",
                12: "STS3036",
                13: "STS3120",
            },
        ),
    }
)
"""Names of the servos with the control table of the STS3215, by model number."""

_SCS = {
    1: "SCS0002",
    2: "SCS0037",
    4: "SCS0009",
    8: "SCS2332",
    12: "SCS45",
    15: "SCS15",
    16: "SCS315",
    25: "SCS115",
    35: "SCS215",
    40: "SCS40",
    60: "SCS6560",
}

SCS_NAMES: Mapping[int, str] = MappingProxyType(
    {
        **_by_model_number(5, _SCS),
        **{5 << 8 | model: name for model, name in _SCS.items()},
        **_by_model_number(9, {15: "SCS15", 25: "SCS215", 35: "SCS225", 40: "SCS40", 41: "SCS25", 46: "SCS46"}),
    }
)
"""Names of the servos with the control table of the SCS0009, by model number."""
