"""Where shipped data lie, and what a name means."""

from pathlib import Path

import pytest

from balance import datasets
from balance.errors import DataError


def test_names_are_found_and_listed() -> None:
    """Shipped names without ending; a name finds its file."""
    assert "four-bar" in datasets.dataset_names("mechanisms", ".xml")
    assert datasets.find_dataset("four-bar", "mechanisms", ".xml").name == "four-bar.xml"


def test_a_file_of_the_user_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of that very name in the working folder is meant before a shipped one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "four-bar").write_text("mine", encoding="utf-8")
    assert datasets.find_dataset("four-bar", "mechanisms", ".xml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("name", ["nine-bar", "", "../mechanisms/four-bar", "four-bar\x00"])
def test_other_names_are_refused(name: str) -> None:
    """No climbing out of the folder: refused with the names that there are."""
    with pytest.raises(DataError, match=r"no such file, and no shipped one.*four-bar"):
        datasets.find_dataset(name, "mechanisms", ".xml")


def test_a_file_without_its_ending_is_suggested(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However short its name is beside the ending, and before names that are more alike; in its folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").touch()
    (tmp_path / "moves").mkdir()
    (tmp_path / "moves" / "deltoid.toml").touch()
    for name in ("m", "moves/deltoid"):
        with pytest.raises(DataError, match=rf"did you mean '{name}.toml'\?"):
            datasets.find_dataset(name, "motions", ".toml")


@pytest.mark.parametrize("name", [".", "..", "mine"])
def test_a_folder_is_told_so(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """That it is a folder, and what would do; a shipped name goes before a folder of that name."""
    monkeypatch.chdir(tmp_path)
    for folder in ("mine", "four-bar"):
        (tmp_path / folder).mkdir()
    with pytest.raises(
        DataError, match=r"is a folder; expected a file \(\.xml or \.urdf\), or a shipped one.*four-bar"
    ):
        datasets.find_dataset(name, "mechanisms", ".xml", ".urdf")
    assert datasets.find_dataset("four-bar", "mechanisms", ".xml").is_file()
