"""How the demonstration speaks."""

from pathlib import Path


def heading(text: str) -> None:
    """Announce a step."""
    print(f"\n{text}\n{'=' * len(text)}")


def saved(path: Path, what: str) -> None:
    """Say where a picture or file went."""
    print(f"   {what}: {path.parent.name}/{path.name}")
