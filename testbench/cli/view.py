"""``testbench view``."""

from pathlib import Path

from balance.cli.framework import argument, command
from balance.cli.options import BROWSER, IDLE, PORT, serve
from balance.cli.printing import complain

from . import options


@command(
    epilog="""\b
Examples:
  testbench view campaign
  testbench view campaign --no-browser --port 8765 --idle 600
\b
The address holds a secret and leads to this machine alone; it ends with the command (Ctrl-C). Findings that are
accepted there are recorded with name and reason, and entered into the ledger. Exit code 1: no run could be opened."""
)
def view(
    runs: tuple[Path, ...] = argument("RUN|CAMPAIGN...", required=True),
    port: int = PORT,
    browser: bool = BROWSER,
    idle: float | None = IDLE,
) -> None:
    """Look at a campaign in the browser, also at runs larger than memory.

    Any channel of any run over time or frequency; two or more runs over each other, aligned by the command or by what
    they show, with their difference and its interval; findings, to be accepted by name and reason; the whole report.
    """
    from ..report.viewer import Viewer

    name, opened, refused = options.runs_shown(runs)
    complain(*refused)
    serve(Viewer(name, opened, {one.run: one.message for one in refused}).server(port), name, browser, idle)
