"""``balance rotor``: rigid rotors and field balancing."""

from ..console import LazyGroup

COMMANDS = {
    "correct": "Corrections in one plane, two or more, from the rotor's masses; bearing reactions before and after.",
    "influence": "Correction weights from trial runs: influence coefficients, any planes, sensors and speeds.",
    "split": "Split a correction over holes, of any weight or from stock weights to a proven optimum.",
    "tolerance": "Permissible residual unbalance of a rigid rotor after ISO 21940-11, and the grade reached.",
    "trial": "A trial mass by the rule of practice.",
}

rotor = LazyGroup(
    "rotor",
    package=__name__,
    lazy=COMMANDS,
    help="Balance rigid rotors: from known masses, or from trial runs in the field.",
)
