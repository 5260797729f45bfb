"""The report of a design as one page: counter-masses, what remains, conditions, a motion with and without them."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..balancing.sizing_study import SizingStudy
from ..dynamics.inverse_dynamics import Response, compared
from ..figures.balancing import draw_responses, titled
from .moving import moving
from .page import Page, document_of, inline_svg
from .plotted import PlottedRun, plotted, spans_for

KINDS = {"F": "Shaking force", "M": "Shaking moment", "t": "Torque of the drives", "d": "Force of the drives"}
"""Headings by the first letter of a component's name."""
SECTIONS = (
    ("sizing", "Counter-masses"), ("conditions", "Conditions"), ("forces", "Forces, moments, torques"),
    ("motion", "The mechanism"), ("series", "Time series"), ("provenance", "Provenance"),
)  # fmt: skip


def design_page(study: SizingStudy) -> Page:
    """The page of counter-masses and of their motion with and without them; ``study`` is of a motion."""
    responses, trajectory = study.responses, study.trajectory
    assert study.motion is not None
    assert trajectory is not None
    motion = Path(study.motion).name
    document = _document(study)
    shown = [row["component"] for row in document["responses"]]
    masses = {one.site: one.mass for one in study.counter_masses if one.mass > 0.0}
    designs = {"without counter-masses": (study.before, {}), "with counter-masses": (study.after, masses)}
    forces = {label: one.force for label, one in zip(designs, responses.values(), strict=True)}
    spans = spans_for([len(one.time) for one in responses.values() for _ in shown])
    series = [
        plotted_response(motion, f"motion {motion}, {label}", side == "after", one, shown, spans)
        for label, (side, one) in zip(designs, responses.items(), strict=True)
    ]
    data = {
        "runs": [run.as_dict() for run in series],
        "motions": [moving(motion, trajectory, designs, forces)],
    }
    figure = inline_svg(draw_responses(responses, shown), "Forces, moments and torques with and without counter-masses")
    about = {"sections": SECTIONS, "motion": motion, "figure": figure, "coarse": trajectory.coarse}
    about |= {"made_small": study.made_small, "allowed": study.allowed}
    return Page(Path(__file__).with_name("design.html"), document, data, about)


def _document(study: SizingStudy) -> dict[str, Any]:
    """What the page shows, units in the keys; under ``sizing`` as `balance size --json` has it."""
    found, (verdict, *rest) = study.best.conditions, str(study).splitlines()
    values = zip(found.values(study.before), found.values(study.after), found.units, strict=True)
    return document_of({
        "mechanism": study.before.name,
        "motion": study.motion,
        "software": {"name": "counterpoise", "version": version("counterpoise")},
        "verdict": verdict,
        "proof": " ".join(line for line in rest if not line.startswith(" ")),
        "sizing": study.document(),
        "moving_mass_kg": {"before": study.before.total_mass, "after": study.after.total_mass},
        "conditions": [
            {"condition": found.text(i), "unit": unit, "before": float(before), "after": float(after)}
            for i, (before, after, unit) in enumerate(values)
        ],
        "responses": compared(study.responses),
    })  # fmt: skip


def plotted_response(
    name: str, label: str, balanced: bool, response: Response, shown: Sequence[str], spans: int
) -> PlottedRun:
    """Components of a response, those ``shown``, for the page, in ``spans`` spans."""
    columns = response.columns()
    channels = (plotted(KINDS[one[0]], *titled(one), response.time, np.asarray(columns[one]), spans) for one in shown)
    return PlottedRun(name, label, balanced, tuple(channels))
