"""A regime: something that goes wrong by degrees, and how each method fares at each degree."""

from collections.abc import Callable
from dataclasses import dataclass

Figures = dict[str, float]  # figure -> value
Measure = Callable[[float, int], dict[str, Figures]]  # severity, seed -> method -> its figures

OURS = "ours"
LARGE, SMALL = "should be large", "should be small"


@dataclass(frozen=True)
class Figure:
    """A number that shows a failure."""

    key: str
    label: str
    better: str  # LARGE or SMALL
    tolerance: float  # worse by this than at the mild end: broken

    @property
    def sign(self) -> float:
        """1 where more is better."""
        return 1.0 if self.better == LARGE else -1.0


SEEN = Figure("seen", "PSNR of what was seen, dB", LARGE, 3.0)
HIDDEN = Figure("hidden", "PSNR of what was hidden, dB", LARGE, 3.0)
WHOLE = Figure("psnr", "PSNR, dB", LARGE, 3.0)
COVERAGE = Figure("coverage", "share of the view that is shown", LARGE, 0.05)
ASTRAY = Figure("astray", "share more than 10 % off in distance", SMALL, 0.05)
DISTANCE = Figure("distance", "mean relative error of distance", SMALL, 0.05)


@dataclass(frozen=True)
class Regime:
    """One small multiple of the atlas."""

    name: str
    users_see: str
    axis: str
    severities: tuple[float, ...]  # in order along the axis
    mild: float  # the one at which nothing is wrong
    figure: Figure
    measure: Measure
    seeds: int = 3
    rows: str = ""  # of the list of failures that the project keeps

    def __post_init__(self):
        assert len(self.severities) >= 5 and self.mild in self.severities, self.name
        assert list(self.severities) == sorted(self.severities), self.name
