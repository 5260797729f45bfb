"""Vibration of the base: amplitudes in noise, and by how much counter-masses reduce them.

From the top: ``reduction`` of a campaign (``comparison`` with simulation and print), its ``run_pairs``;
``ratio_interval`` of two amplitudes; ``condition``: an amplitude from one run or from repeats, their scatter by
``repeatability``; ``amplitude_likelihood`` and ``amplitude`` of one run, its noise by ``noise_floor``.
"""

from .amplitude import Amplitude
from .amplitude_likelihood import AmplitudeLikelihood
from .condition import CampaignNoise, ConditionAmplitude
from .noise_floor import Noise
from .ratio_interval import Ratio
from .repeatability import Group, Repeatability

__all__ = [
    "Amplitude", "AmplitudeLikelihood", "CampaignNoise", "ConditionAmplitude", "Group", "Noise", "Ratio",
    "Repeatability",
]  # fmt: skip
