"""Reductions of records that are arrays: the analysis below the file layer."""

from dataclasses import dataclass

import numpy as np

from testbench.vibration import Amplitude
from testbench.vibration.condition import Condition
from testbench.vibration.metrics import Measure
from testbench.vibration.reduction import CampaignLikelihoods, Reduction
from testbench.vibration.run_pairs import ConditionKey, Pair

PLACE = "base_acc", "x"
KEY = ConditionKey(5.0, "x", 3.0, "simulated")


@dataclass(frozen=True, eq=False)
class Named:
    """All that a reduction needs of a stored run."""

    name: str


def reduced(
    balanced: list[np.ndarray],
    unbalanced: list[np.ndarray],
    rate_hz: float,
    rest_s: float | None,
    measure: Measure | None = None,
    step: float = 0.0,
) -> tuple[Reduction, list[str]]:
    """Of repeats (n,) each at rest for ``rest_s`` [s], and the codes of what is found."""
    span = None if rest_s is None else (0.0, rest_s)

    def records(runs: list[np.ndarray]) -> tuple[dict[tuple[str, str], Amplitude], ...]:
        return tuple(
            {
                PLACE: Amplitude.of(
                    v[None], rate_hz, measure or Measure(), span, (rest_s or 0.0, len(v) / rate_hz), [step]
                )[0]
            }
            for v in runs
        )

    sides = [
        tuple(Named(f"{side}{k}") for k in range(len(runs)))
        for side, runs in (("with", balanced), ("without", unbalanced))
    ]
    pair = Pair(KEY, {"counter_A0A": 10.0}, *sides)  # type: ignore[arg-type]
    condition = Condition(pair, measure or Measure(), records(balanced), records(unbalanced))
    likelihoods = CampaignLikelihoods.of([condition])
    return likelihoods.reduction(condition, PLACE), [f.message for f in likelihoods.scatter_findings(condition)]
