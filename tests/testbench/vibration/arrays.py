"""Reductions of records that are arrays: the analysis below the file layer."""

from dataclasses import dataclass
from typing import Any

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


def condition(
    balanced: list[np.ndarray],
    unbalanced: list[np.ndarray],
    rate_hz: float,
    rest_s: float | None,
    measure: Measure | None = None,
    step: float = 0.0,
    name: str = "",
) -> Condition:
    """Of repeats (n,) each at rest for ``rest_s`` [s]; with0, without0 and so on, behind a ``name``, are the runs."""
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
        tuple(Named(f"{name}{side}{k}") for k in range(len(runs)))
        for side, runs in (("with", balanced), ("without", unbalanced))
    ]
    pair = Pair(KEY, {"counter_A0A": 10.0}, *sides)  # type: ignore[arg-type]
    return Condition(pair, measure or Measure(), records(balanced), records(unbalanced))


def reduced(*of: Any, **more: Any) -> tuple[Reduction, list[str]]:
    """Of one :func:`condition`, and what is found of its repeats."""
    one = condition(*of, **more)
    likelihoods = CampaignLikelihoods.of([one])
    return likelihoods.reduction(one, PLACE), [f.message for f in likelihoods.scatter_findings(one)]
