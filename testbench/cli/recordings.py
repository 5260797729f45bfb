"""``testbench recordings``."""

import shlex
import sys
from pathlib import Path

import click

from balance.cli.framework import EXIT_REFUSED, JSON, Answer, argument, command, option
from balance.cli.printing import emit_json, emit_table, say
from balance.results import document, table

from .. import public_recordings as public
from ..errors import RecordingError


@click.group()
def recordings() -> None:
    """Public recordings of other people, to read, check and show; each of one commit, known by its SHA-256."""


@command("list", group=recordings)
def list_recordings() -> Answer:
    """List them: file, content, size, licence and source."""
    known = list(public.recordings_by_file().values())
    return Answer(
        {"recordings": known},
        lambda: emit_table(f"Public recordings: {len(known)}", *table(public.PublicRecording, known)),
    )


@command(
    group=recordings,
    epilog="""\b
Examples:
  testbench recordings fetch
  testbench recordings fetch 09 10 --to recordings
\b
Where COUNTERPOISE_RECORDINGS names a folder, that takes the place of the network.
Exit codes: 0 all are there, 1 some were refused (the others are fetched).""",
)
def fetch(
    names: tuple[str, ...] = argument("[NAME]..."),
    to: Path | None = option("Into this folder; else the user's cache.", click.Path(path_type=Path, file_okay=False)),
    as_json: bool = JSON,
) -> int:
    """Fetch recordings, all or those named (the beginning of a name will do), and verify each by its SHA-256."""
    chosen = [public.recording_named(name) for name in names] or list(public.recordings_by_file().values())
    folder = (to or public.folder()).absolute()
    outcomes = []
    for recording in chosen:
        status, message = _fetched(recording, folder)
        outcomes.append({**document(recording), "status": status, "message": message})
        if not as_json:
            say(f"{recording.file}: {status}: {message}")
    setting = f"{'set' if sys.platform == 'win32' else 'export'} {public.FOLDER_VARIABLE}={shlex.quote(str(folder))}"
    if as_json:
        emit_json({"folder": str(folder), "recordings": outcomes, "to_use_them": setting})
    else:
        say(f"To use them in tests and the demo: {setting}")
    return EXIT_REFUSED if any(outcome["status"] == "refused" for outcome in outcomes) else 0


def _fetched(recording: public.PublicRecording, folder: Path) -> tuple[str, str]:
    """``present``, ``fetched`` or ``refused``, and more about it."""
    path = folder / recording.file
    try:
        status = "present" if path.is_file() else "fetched"
        public.checked(path, recording) if path.is_file() else public.fetch(recording, folder)
    except RecordingError as error:
        return "refused", str(error)
    return status, f"{recording.bytes} bytes, SHA-256 {recording.sha256[:12]}... verified, {recording.credit}"
