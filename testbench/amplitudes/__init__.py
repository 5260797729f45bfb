"""Amplitudes in noise, and what a ratio of two of them may be.

Downwards: ``ratio`` of two sides, ``side`` of one or several runs, ``amplitude`` of one run, ``statistic`` the law of
each metric, ``noise`` as the rest stretch shows it, ``unified`` intervals at a bound.
"""

from .amplitude import Amplitude
from .noise import Noise
from .ratio import Ratio
from .side import Side

__all__ = ["Amplitude", "Noise", "Ratio", "Side"]
