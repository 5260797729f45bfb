"""The report of a design as one page: counter-masses, what remains, conditions, a motion with and without them."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..balancing import Sizing
from ..balancing.remaining_force import Verdict
from ..balancing.sizing import sizing_document
from ..closure import Trajectory
from ..dynamics.inverse_dynamics import Response, simulate
from ..figures.balancing import draw_responses, titled
from .moving import moving
from .page import Page, document_of, inline_svg
from .plotted import PlottedRun, plotted, spans_for

KINDS = {"F": "Shaking force", "M": "Shaking moment", "t": "Torque of the drives", "d": "Force of the drives"}
"""Headings by the first letter of a component's name."""
ZERO = 1e-9
"""Peak up to which a component counts as zero throughout [N, N m]."""
SECTIONS = (
    ("sizing", "Counter-masses"),
    ("conditions", "Conditions"),
    ("forces", "Forces, moments, torques"),
    ("motion", "The mechanism"),
    ("series", "Time series"),
    ("provenance", "Provenance"),
)


def design_page(sizing: Sizing, verdict: Verdict, trajectory: Trajectory, motion: str) -> Page:
    """The page of counter-masses and of a motion with and without them; ``motion`` names the trajectory."""
    responses = {side: simulate(getattr(sizing, side), trajectory) for side in ("before", "after")}
    document = _document(sizing, verdict, motion, responses)
    shown = [row["component"] for row in document["responses"]]
    masses = {one.site: one.mass for one in sizing.counter_masses if one.mass > 0.0}
    designs = {"without counter-masses": (sizing.before, {}), "with counter-masses": (sizing.after, masses)}
    forces = {label: one.force for label, one in zip(designs, responses.values(), strict=True)}
    data = {
        "runs": [run.as_dict() for run in _series(motion, responses, shown)],
        "motions": [moving(f"motion {motion}", trajectory, designs, forces)],
    }
    figure = inline_svg(draw_responses(responses, shown), "Forces, moments and torques with and without counter-masses")
    about = {"sections": SECTIONS, "motion": motion, "figure": figure}
    return Page(Path(__file__).with_name("design.html"), document, data, about)


def _document(sizing: Sizing, verdict: Verdict, motion: str, responses: Mapping[str, Response]) -> dict[str, Any]:
    """What the page shows, units in the keys; under ``sizing`` as `balance size --json` has it."""
    found = sizing.conditions
    values = zip(found.values(sizing.before), found.values(sizing.after), found.units, strict=True)
    return document_of({
        "mechanism": sizing.before.name,
        "motion": motion,
        "software": {"name": "counterpoise", "version": version("counterpoise")},
        "verdict": _verdict(sizing, verdict, motion),
        "sizing": sizing_document(sizing) | {
            "balanced": verdict.balanced, "attainable_with_any_mass": verdict.attainable,
            "rms_before_N": verdict.before, "rms_N": verdict.after, "remaining_percent": sizing.remaining_percent(),
        },
        "moving_mass_kg": {"before": sizing.before.total_mass, "after": sizing.after.total_mass},
        "conditions": [
            {"condition": found.text(i), "unit": unit, "before": float(before), "after": float(after)}
            for i, (before, after, unit) in enumerate(values)
        ],
        "responses": [
            {"component": name, **{f"{what}_{side}": getattr(one, what)()[name] for what in ("rms", "peak")
                                   for side, one in responses.items()}}
            for name in responses["before"].columns()
            if max(one.peak()[name] for one in responses.values()) > ZERO
        ],
    })  # fmt: skip


def _verdict(sizing: Sizing, verdict: Verdict, motion: str) -> str:
    """How much of the force remains, in one sentence, and what would remove it."""
    added = f"{sizing.added_mass:.4f} kg added"
    if verdict.balanced:
        return f"Balanced completely in motion {motion}, {added}."
    share = 100.0 * verdict.after / verdict.before
    sizes = f"{verdict.after:.4g} N of {verdict.before:.4g} N"
    remains = f"{share:.3g} % of the RMS force remains in motion {motion} ({sizes})"
    if verdict.attainable:
        return f"Not balanced completely: {remains}, {added}; masses of other sizes at these sites would balance it."
    bodies = ", ".join(" or ".join([site.body, *site.alternatives]) for site in verdict.needed)
    needs = f"with a site on body {bodies} less would" if bodies else "no counter-mass on any body would lessen it"
    return f"Not balanced completely: {remains}, {added}; {needs}."


def _series(motion: str, responses: Mapping[str, Response], shown: list[str]) -> list[PlottedRun]:
    """Every component that is not zero, before and after."""
    spans = spans_for([len(one.time) for one in responses.values() for _ in shown])
    words = {"before": "without", "after": "with"}
    return [
        plotted_response(motion, f"motion {motion}, {words[side]} counter-masses", side == "after", one, shown, spans)
        for side, one in responses.items()
    ]


def plotted_response(
    name: str, label: str, balanced: bool, response: Response, shown: Sequence[str], spans: int
) -> PlottedRun:
    """Components of a response, those ``shown``, for the page, in ``spans`` spans."""
    columns = response.columns()
    channels = (plotted(KINDS[one[0]], *titled(one), response.time, np.asarray(columns[one]), spans) for one in shown)
    return PlottedRun(name, label, balanced, tuple(channels))
