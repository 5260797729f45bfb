"""``testbench formats``."""

import click

from balance.cli.console import emit_json, emit_table, json_option


@click.command(
    epilog="""\b
Example:
  testbench formats
\b
A package adds a format by an entry point of the group counterpoise.readers."""
)
@json_option
def formats(as_json: bool) -> None:
    """Which formats can be read, and what each needs installed."""
    from ..readers import readers

    known = readers()
    if as_json:
        emit_json({
            "formats": [{"name": r.name, "extensions": list(r.extensions), "needs": r.needs or None} for r in known]
        })  # fmt: skip
        return
    rows = [[r.name, " ".join(r.extensions), r.needs or "nothing more"] for r in known]
    emit_table("Formats", ["format", "extensions", "needs"], rows)
