"""Lengths as messages write them."""

from math import inf, nan

from drivers.api.measures import length_text
from tests.cases import each

TEXTS = {
    0.0: "0 m", -0.0004: "0 m", 0.0006: "1 mm", 0.0041: "4 mm", 0.0094: "9 mm", 0.0096: "1 cm", 0.35: "35 cm",
    -0.35: "-35 cm", 0.994: "99 cm", 0.996: "1 m", 1.0: "1 m", 1.25: "1.25 m", 12.34: "12.3 m", 1234.5: "1234 m",
    inf: "an unknown distance", nan: "an unknown distance",
}  # fmt: skip


@each("length", list(TEXTS))
def test_length_is_formatted_in_its_best_unit(length: float) -> None:
    assert length_text(length) == TEXTS[length]
