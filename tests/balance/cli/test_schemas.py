"""Schemas of input files: every key is described, and the shipped files are valid by them."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest
from click.testing import CliRunner

import balance.cli.files
import testbench.cli.files
from balance import datasets
from balance.cli.files import file_schema, reference_page

MODELS = {**balance.cli.files.MODELS, **testbench.cli.files.MODELS}
FOLDERS = {"materials": "materials", "springs": "springs", "trial-runs": "rotors"}
"""Where the shipped files are, if not in the plural."""


def shipped(kind):
    """The folder of datasets of a kind of file."""
    return FOLDERS.get(kind, f"{kind}s")


@pytest.mark.parametrize("name", MODELS)
def test_every_key_says_what_it_means(name):
    """A table and each of its keys has a meaning; a quantity also its unit, in brackets."""
    found = file_schema(MODELS, name)
    for title, table in {name: found, **found.get("$defs", {})}.items():
        assert table.get("description"), title
        for key, described in table.get("properties", {}).items():
            assert described.get("description"), f"{title}.{key}"
            if "unit" in described and name in balance.cli.files.MODELS:
                assert "[" in described["description"], f"{title}.{key}"


@pytest.mark.parametrize("name", [kind for kind in sorted(MODELS) if datasets.dataset_names(shipped(kind), ".toml")])
def test_the_shipped_files_are_valid(name):
    """An editor that checks by the schema refuses none of them."""
    found, folder = file_schema(MODELS, name), shipped(name)
    jsonschema.Draft202012Validator.check_schema(found)
    paths = [datasets.find_dataset(shipped, folder, ".toml") for shipped in datasets.dataset_names(folder, ".toml")]
    contents = [tomllib.loads(path.read_text(encoding="utf-8")) for path in paths]
    if folder == "rotors":
        contents = [content for content in contents if ("masses" in content) == (name == "rotor")]
    for content in contents:
        jsonschema.Draft202012Validator(found).validate(content)


def test_the_reference_page_is_that_of_the_models():
    """docs/files.md says what the loaders take: `testbench schema --text > docs/files.md` writes it anew."""
    page = (Path(__file__).parents[3] / "docs" / "files.md").read_text("utf-8")
    assert page == reference_page(MODELS, testbench.cli.files.MODELS)
    assert page == CliRunner().invoke(testbench.cli.files.schema, ["--text"]).output
    assert "A positive value pushes the joint towards smaller coordinates" in page
    assert "M = (stall torque / no-load speed) (nominal - n)" in page
    assert ">>>" not in page
    assert "list of (`Fx` or `Fy` or `Fz` or `Mx` or `My` or `Mz`) or `rest`" in page  # the word is no item of it


@pytest.mark.parametrize(("package", "kind"), [(balance, "drive"), (testbench, "rig")])
def test_the_command_prints_it_and_lists_the_kinds(package, kind):
    """By name; an unknown one is a wrong command line."""
    command = package.cli.files.schema
    done = CliRunner().invoke(command, [kind])
    assert json.loads(done.stdout) == file_schema(MODELS, kind)
    wrong = CliRunner().invoke(command, ["machine"])
    assert wrong.exit_code == 2
    assert f" {kind}" in wrong.output.partition("expected")[2]
