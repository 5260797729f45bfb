"""Uncertainty budgets in the form of JCGM 100:2008 (table H.1): what contributes how much to one number's interval."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from ..results import Key, finite, table
from .estimate import coverage_factor

Distribution = Literal["normal", "t", "rectangular"]


@dataclass(frozen=True)
class Contribution:
    """What one source adds."""

    source: Annotated[str, Key("", "source")]
    evaluation: Annotated[Literal["A", "B"], Key("", "type")]
    """From scatter, or from other knowledge."""
    standard_uncertainty: Annotated[float, Key("", "standard uncertainty", ".3g")]
    """Of the input, in ``unit``."""
    unit: Annotated[str, Key("", "unit")]
    sensitivity: Annotated[float, Key("sensitivity_coefficient", "sensitivity", ".3g")]
    """By how much the number changes per unit of the input."""
    distribution: Annotated[Distribution, Key("", "distribution")]
    degrees_of_freedom: Annotated[float, Key("", "freedom", lambda f: f"{f:.3g}", to=finite)] = np.inf
    """Infinite (JSON: null) where it is known."""

    @property
    def size(self) -> Annotated[float, Key("contribution", "contribution", ".3g")]:
        """Standard uncertainty that it adds, in the number's unit: |sensitivity| times its standard uncertainty."""
        return abs(self.sensitivity) * self.standard_uncertainty


@dataclass(frozen=True)
class Budget:
    """Of one number: independent contributions, whose squares add."""

    quantity: Annotated[str, Key()]
    value: Annotated[float, Key()]
    unit: Annotated[str, Key()]
    contributions: Annotated[tuple[Contribution, ...], Key()]
    degrees_of_freedom: Annotated[float, Key(to=finite)] = np.inf
    """Of the combined standard uncertainty."""

    @property
    def standard_uncertainty(self) -> Annotated[float, Key("combined_standard_uncertainty")]:
        """All contributions together, in ``unit``."""
        return float(np.sqrt(sum(one.size**2 for one in self.contributions)))

    @property
    def factor(self) -> Annotated[float, Key("coverage_factor")]:
        """Of the 95 % interval."""
        return coverage_factor(self.degrees_of_freedom)

    @property
    def half_width(self) -> Annotated[float, Key("expanded_uncertainty")]:
        """Of the 95 % interval, in ``unit``, where the number depends on what contributes like a straight line."""
        return self.factor * self.standard_uncertainty

    @property
    def shares(self) -> Annotated[list[float], Key("variance_shares")]:
        """Of each contribution in the variance [-]."""
        whole = self.standard_uncertainty**2
        return [one.size**2 / whole if whole > 0.0 else 0.0 for one in self.contributions]

    @property
    def text(self) -> str:
        """The number, its combined and its expanded uncertainty."""
        return (
            f"{self.quantity}: {self.value:.4g} {self.unit}, combined standard uncertainty "
            f"{self.standard_uncertainty:.3g}, "
            f"k = {self.factor:.2f}, expanded {self.half_width:.3g} {self.unit} (95 %)"
        )


def budget_rows(budget: Budget) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a budget's table, the largest contribution first, each with its share of the variance."""
    header, rows = table(Contribution, budget.contributions)
    order = sorted(range(len(rows)), key=lambda i: -budget.shares[i])
    return [*header, "share"], [[*rows[i], f"{budget.shares[i]:.1%}"] for i in order]
