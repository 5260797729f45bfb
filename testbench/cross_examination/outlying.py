"""Which of several values are unlike the others, with a stated rate of false alarms."""

import numpy as np

from balance.arrays import Floats, Mask
from balance.estimation.estimate import student_quantile

FALSE_ALARMS = 0.01
"""Rate at which something is said of an honest campaign by one kind of comparison, where errors are normal."""


def outlying(values: Floats, rate: float) -> Mask:
    """Of values (n,) [any unit], normally distributed but for fewer than half: which are of no such sample, (n,).

    Generalized extreme Studentized deviate, ``rate`` that of a false alarm in all n: Rosner, B., Percentage points for
    a generalized ESD many-outlier procedure, Technometrics 25 (1983), 165-172, the rate shared by its
    steps: below 15 values they add up. Of fewer than three none is.
    """
    kept, order, found = np.ones(len(values), dtype=bool), list[int](), 0
    steps = (len(values) - 1) // 2
    for _ in range(steps):
        apart, left = np.abs(values - values[kept].mean()), int(kept.sum())
        t = student_quantile(1.0 - rate / (2.0 * left * steps), left - 2.0)
        limit = (left - 1.0) * t / np.sqrt((left - 2.0 + t * t) * left)
        order.append(worst := int(np.argmax(np.where(kept, apart, -1.0))))
        found = len(order) if apart[worst] > limit * values[kept].std(ddof=1) else found
        kept[worst] = False
    mask = np.zeros(len(values), dtype=bool)
    mask[order[:found]] = True
    return mask
