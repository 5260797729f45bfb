"""Amplitudes in noise, and what a ratio of two of them may be.

Downwards: ``ratio`` of two sides, ``side`` of one or several runs, ``repeatability`` of a campaign, ``judged`` and
``amplitude`` of one run, ``statistic`` the law of each metric, ``noise`` as the rest stretch shows it, ``unified``
intervals at a bound.
"""

from .amplitude import Amplitude
from .amplitude_likelihood import AmplitudeLikelihood
from .condition import ConditionAmplitude
from .noise_floor import Noise
from .ratio_interval import Ratio
from .repeatability import Group, Repeatability

__all__ = ["Amplitude", "AmplitudeLikelihood", "ConditionAmplitude", "Group", "Noise", "Ratio", "Repeatability"]
