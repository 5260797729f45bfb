"""``balance engine``: slider-cranks and engines."""

from ..console import LazyGroup

COMMANDS = {
    "single": "One slider-crank: rod as point masses, shaking force exact and by orders, partial balance.",
    "free": "Free forces and moments of an engine by orders, place of the resultant, balance shafts, firing.",
    "table": "The common engines side by side.",
    "mechanism": "Write an engine as a mechanism file (MJCF).",
}

engine = LazyGroup(
    "engine",
    package=__name__,
    lazy=COMMANDS,
    help="Shaking forces and moments of slider-cranks and engines, and what balances them.",
)
