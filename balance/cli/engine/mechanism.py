"""``balance engine mechanism``."""

from pathlib import Path

import click


@click.command(
    epilog="""\b
Examples:
  balance engine mechanism v4-72-offset -o v4.xml
  balance conditions v4.xml"""
)
@click.argument("engine", metavar="ENGINE")
@click.option("-o", "--output", type=click.Path(dir_okay=False), metavar="FILE", help="Write here [default: stdout].")
def mechanism(engine: str, output: str | None) -> None:
    """Write ENGINE, a sheet with sizes, as a mechanism file (MJCF) for the other commands, Pinocchio and MuJoCo."""
    from ...engines.engine_files import load_engine, mjcf

    text = mjcf(load_engine(engine))
    if output is None:
        click.echo(text, nl=False)
    else:
        Path(output).write_text(text, encoding="utf-8")
