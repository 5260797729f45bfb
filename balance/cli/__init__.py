"""The command ``balance``."""

from .console import LazyGroup, run

COMMANDS = {
    "conditions": "Which conditions balance this mechanism, found from its model.",
    "size": "Which counter-masses balance it, exactly or from stock plates.",
    "check": "What given counter-masses leave unbalanced.",
    "simulate": "Shaking force, shaking moment and drive torque of a motion.",
    "linkage": "Planar linkages balanced completely, by counter-masses and gears.",
    "rotor": "Rigid rotors: correction planes, trial runs, holes and stock weights, permissible unbalance.",
    "engine": "Slider-cranks and engines: shaking force, partial balance, free forces and moments, shafts.",
    "drive": "Speed of a motor-driven machine over a turn: steady, start-up, flywheel.",
    "static": "Potential energy constant over the workspace, by counter-masses or springs.",
    "methods": "The named ways of balancing side by side: left over, cost, need.",
}


def main() -> None:
    """Run ``balance``."""
    import click

    group = LazyGroup(
        "balance",
        package=__name__,
        lazy=COMMANDS,
        help="Model a mechanism with closed loops, find its balance conditions, size its counter-masses.",
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    click.version_option(package_name="counterpoise")(group)
    run(group, "balance")
