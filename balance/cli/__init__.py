"""The command ``balance``."""

from .framework import run

COMMANDS = {
    "conditions": ("mechanism", "Which conditions balance this mechanism, found from its model."),
    "assemble": ("mechanism", "The closed configurations of a mechanism: how its loops can be put together."),
    "size": ("size", "Which counter-masses balance it, exactly or from stock plates."),
    "check": ("mechanism", "What given counter-masses leave unbalanced."),
    "simulate": ("mechanism", "Shaking force, shaking moment and drive torque of a motion."),
    "report": ("report", "Counter-masses, conditions, forces and the moving mechanism on one page."),
    "animate": ("report", "The mechanism moving, on a page or as a video, with centre of mass and shaking force."),
    "view": ("report", "The mechanism in the browser: move it, mount masses, see force, moment, torque at once."),
    "sweep": ("sweep", "Force, moment and torque of many designs: all combinations of masses and places."),
    "tolerance": ("sweep", "What errors of masses and places cost in shaking force."),
    "tradeoff": ("sweep", "What less shaking force costs in moment, torque and mass: the front of a motion."),
    "linkage": ("linkage", "Planar linkages balanced completely, by counter-masses and gears."),
    "rotor": ("rotor", "Rigid rotors: correction planes, trial runs, holes and stock weights, permissible unbalance."),
    "engine": ("engine", "Slider-cranks and engines: shaking force, partial balance, free forces and moments, shafts."),
    "drive": ("drive", "Speed of a motor-driven machine over a turn: steady, start-up, flywheel."),
    "static": ("methods", "Potential energy constant over the workspace, by counter-masses or springs."),
    "methods": ("methods", "The named ways of balancing side by side: left over, cost, need."),
    "files": ("files", "What is shipped: mechanisms, motions, engines and others; copies of it, to be edited."),
    "schema": ("files", "The JSON schema of an input file: its keys, units, defaults."),
}


def main() -> None:
    """Run ``balance``."""
    text = "Model a mechanism with closed loops, find its balance conditions, size its counter-masses."
    run("balance", __name__, COMMANDS, text)
