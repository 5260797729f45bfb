"""``balance report``, ``balance animate`` and ``balance view``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from . import options, size
from .framework import Answer, command, option
from .printing import emit_findings, say
from .sweep import TOLERANCES

if TYPE_CHECKING:
    from ..balancing.tolerance import Tolerance

STILLS = (".png", ".svg", ".pdf")


def _output(*endings: str) -> Any:  # noqa: ANN401
    """``-o``; another ending, or no folder for it, is refused before anything is computed."""

    def checked(_context: click.Context, _parameter: click.Parameter, path: Path) -> Path:
        if path.suffix.lower() not in endings:
            raise click.BadParameter(f"{path}: expected a name ending in {' or '.join(endings)}")
        from ..report.page import writable

        return writable(path)

    text = f"What to write, a name ending in {' or '.join(endings)}."
    kind = click.Path(path_type=Path, dir_okay=False)
    return option(text, kind, "-o", "--output", required=True, callback=checked)


@command(
    epilog="""\b
Examples:
  balance report four-bar --motion four-bar -o report.html
  balance report parallelogram-6bar -p platform=5kg --motion x --stock kiper2019 -o report.html
  balance report four-bar --motion four-bar --limit counter_A0A=1kg --added 2kg -o report.html
  balance report four-bar --motion four-bar -c counter_A0A=1.07kg -c counter_B0B=1.37kg \\
    --tolerance counter_A0A.mass=5g --tolerance counter_B0B.x=0.2mm -o report.html
  balance report parallelogram-6bar -p platform=1.451kg -p platform=5kg --motion x --fixed -o report.html

\b
Several payloads of one body have one page, sets as balance size finds them. With --counter the page is of those masses,
with each payload; they have the inertia of a disc with the site's radius of gyration. --tolerance as balance tolerance.
\b
Exit code 3: no masses at these sites balance it completely, or plates or masses that are given leave more than 5 %
where others would; or the effect of a tolerance is not linear."""
)
def report(
    mechanism: str = options.MECHANISM,
    payload: options.Pairs = options.PAYLOADS_OF_ONE_BODY,
    counter: options.Masses = options.COUNTERS,
    site: tuple[str, ...] = options.SITES,
    without: tuple[str, ...] = size.WITHOUT,
    stock: str | None = size.STOCK,
    limit: options.Masses = options.LIMITS,
    added: float | None = options.ADDED,
    equal: tuple[str, ...] = size.EQUAL,
    objective: tuple[str, ...] = size.OBJECTIVE,
    rig: str | None = size.RIG,
    fixed: bool = size.FIXED,
    tolerances: "tuple[Tolerance, ...]" = TOLERANCES,
    motion: str = options.MOTION,
    output: Path = _output(".html"),
) -> Answer:
    """The counter-masses of MECH on one page to sign and mail: verdict, sizing, conditions, a motion with and without.

    The page reads without network and without script, and shows the mechanism moving to scale. Counter-masses are those
    of balance size with the same options, or those given; --json prints every number of the page.
    """
    from ..report.design_page import design_page

    others = {
        "--site": site, "--without": without, "--stock": stock, "--limit": limit, "--equal": equal, "--rig": rig,
        "--fixed": fixed, "--added": added is not None,
    }  # fmt: skip
    if counter and (named := [name for name, value in others.items() if value]):
        raise click.UsageError(
            f"--counter gives the masses, and {' and '.join(named)} is for sizing them: leave one out"
        )
    found = size.sized(
        mechanism, size.growing(payload), motion, stock, site, without, limit, added, equal, objective, rig, fixed,
        given=counter,
    )  # fmt: skip
    page = design_page(found, tolerances)
    path = page.write(output)

    def show() -> None:
        say(f"{page.document['mechanism']}: {page.document['verdict']}\nWrote {path}.")
        emit_findings(("not_linear", said) for said in page.about["doubts"])

    return Answer({**page.document, "written": str(path)}, show, found.has_finding or bool(page.about["doubts"]))


@command(
    epilog="""\b
Examples:
  balance animate delta --motion delta -o delta.html
  balance animate four-bar --motion four-bar -c counter_A0A=1.07kg -c counter_B0B=1.37kg -o four-bar.mp4
  balance animate four-bar --motion four-bar -c counter_A0A=1.07kg -c counter_B0B=1.37kg -o four-bar.svg
\b
A video has at most 160 pictures, 25 a second, and states its pace. It needs pip install 'counterpoise[video]'.
A still is the one of these pictures with the largest shaking force, without counter-masses."""
)
def animate(
    mechanism: str = options.MECHANISM,
    payload: options.Masses = options.PAYLOADS,
    counter: options.Masses = options.COUNTERS,
    motion: str = options.MOTION,
    output: Path = _output(".html", ".mp4", *STILLS),
) -> None:
    """MECH to scale, moving on a page or in a video, or as a still: centre of mass, shaking force as an arrow.

    With --counter side by side without and with the counter-masses, arrows to one scale.
    """
    from ..front_door import follow
    from ..report import video

    video.writable_animation(output)
    model = options.load_mechanism_option(mechanism, payload)
    drawn = video.write_animation(output, model, motion, follow(model, motion), counter)
    forces = ", ".join(f"{panel['largest_N']:.4g} N {panel['label']}" for panel in drawn["panels"])
    say(f"{model.name}, motion {Path(motion).name}: largest shaking force {forces} (simulated).\nWrote {output}.")


@command(
    epilog="""\b
Examples:
  balance view parallelogram-6bar -p platform=5kg --motion x --motion triangle
  balance view delta --motion delta
  balance view my-machine.xml --no-browser --port 8765
\b
The address holds a secret and leads to this machine alone; it ends with the command (Ctrl-C)."""
)
def view(
    mechanism: str = options.MECHANISM,
    payload: options.Masses = options.PAYLOADS,
    site: tuple[str, ...] = options.SITES,
    motion: tuple[str, ...] = option(
        "Motions to choose from, files or shipped; moves of each driven joint alone are there without any.",
        metavar="TOML",
    ),
    port: int = options.PORT,
    browser: bool = options.BROWSER,
    idle: float | None = options.IDLE,
) -> None:
    """MECH in the browser: move it by hand or in a motion, mount masses, see force, moment and torque at once.

    Peak and RMS stand beside those without counter-masses and those with the ones that balance size finds.
    """
    from ..report.mechanism_view import MechanismView

    model = options.load_mechanism_option(mechanism, payload)
    options.serve(MechanismView(model, motion, site).server(port), model.name, browser, idle)
