"""Schemas of input files: every key is described, and the shipped files are valid by them."""

import tomllib

import jsonschema
import pytest

from balance import datasets
from balance.cli.schemas import schema
from balance.errors import DataError

FOLDERS = {
    "drive": "drives", "engine": "engines", "linkage": "linkages", "materials": "materials", "motion": "motions",
    "rotor": "rotors", "springs": "springs", "trial-runs": "rotors",
}  # fmt: skip


def tables(described):
    """The table of a file and those within it, by title."""
    return {described["title"]: described, **described.get("$defs", {})}


@pytest.mark.parametrize("name", FOLDERS)
def test_every_key_says_what_it_means(name):
    """A table and each of its keys has a meaning; a quantity also its unit, in brackets."""
    for title, table in tables(schema(name)).items():
        assert table.get("description"), title
        for key, described in table.get("properties", {}).items():
            assert described.get("description"), f"{title}.{key}"
            if "unit" in described:
                assert "[" in described["description"], f"{title}.{key}"


@pytest.mark.parametrize("name", FOLDERS)
def test_the_shipped_files_are_valid(name):
    """An editor that checks by the schema refuses none of them."""
    found = schema(name)
    jsonschema.Draft202012Validator.check_schema(found)
    paths = [
        datasets.find_dataset(shipped, FOLDERS[name], ".toml")
        for shipped in datasets.dataset_names(FOLDERS[name], ".toml")
    ]
    contents = [tomllib.loads(path.read_text(encoding="utf-8")) for path in paths]
    if FOLDERS[name] == "rotors":
        contents = [content for content in contents if ("masses" in content) == (name == "rotor")]
    assert contents
    for content in contents:
        jsonschema.Draft202012Validator(found).validate(content)


def test_an_unknown_kind_lists_those_that_there_are():
    """By name."""
    with pytest.raises(DataError, match="'machine' is no kind of input file: there are drive, engine"):
        schema("machine")
