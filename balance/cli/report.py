"""``balance animate``."""

from pathlib import Path

import click

from . import options


def _html(_context: click.Context, _parameter: click.Parameter, path: Path) -> Path:
    """The path of a page; another ending is refused before anything is computed."""
    if path.suffix.lower() != ".html":
        raise click.BadParameter(f"{path}: expected a name ending in .html")
    return path


output_option = click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), required=True, callback=_html,
    help="The page to write, a name ending in .html.",
)  # fmt: skip


@click.command(
    epilog="""\b
Examples:
  balance animate delta --motion delta -o delta.html
  balance animate four-bar --motion four-bar -c counter_A0A=1.07kg -c counter_B0B=1.37kg -o four-bar.html"""
)
@options.mechanism_argument
@options.payload_option
@options.counter_option
@click.option("--motion", required=True, metavar="TOML", help="A motion file, or a shipped one: x, y, triangle.")
@output_option
def animate(
    mechanism: str,
    payload: tuple[tuple[str, float], ...],
    counter: tuple[tuple[str, float], ...],
    motion: str,
    output: Path,
) -> None:
    """MECH moving to scale on a page: play and scrub, centre of mass and shaking force as arrows.

    With --counter side by side without and with the counter-masses, arrows to one scale.
    """
    from ..report.moving import animation_page, designs_of

    model = options.load_mechanism_option(mechanism, payload)
    designs = designs_of(model, options.distinct(counter, "--counter"))
    page = animation_page(model.name, motion, options.follow_motion(model, motion), designs)
    click.echo(f"Wrote {page.write(output)}.")
