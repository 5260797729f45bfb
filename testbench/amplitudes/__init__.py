"""Amplitudes in noise, and what a ratio of two of them may be.

Downwards: ``ratio`` of two sides, ``side`` of one or several runs, ``repeatability`` of a campaign, ``judged`` and
``amplitude`` of one run, ``statistic`` the law of each metric, ``noise`` as the rest stretch shows it, ``unified``
intervals at a bound.
"""

from .amplitude import Amplitude
from .judged import Judged
from .noise import Noise
from .ratio import Ratio
from .repeatability import Group, Repeatability
from .side import Side

__all__ = ["Amplitude", "Group", "Judged", "Noise", "Ratio", "Repeatability", "Side"]
