"""Schemas of rigs and plans: every key is described, and the shipped files are valid by them."""

import tomllib

import jsonschema
import pytest

from balance import datasets
from testbench.cli.schemas import schema
from testbench.errors import RigError


@pytest.mark.parametrize("name", ["plan", "rig", "run-table"])
def test_every_key_says_what_it_means(name):
    """A table and each of its keys."""
    found = schema(name)
    for title, table in {name: found, **found.get("$defs", {})}.items():
        assert table.get("description"), title
        for key, described in table.get("properties", {}).items():
            assert described.get("description"), f"{title}.{key}"


@pytest.mark.parametrize("name", ["plan", "rig"])
def test_the_shipped_files_are_valid(name):
    """An editor that checks by the schema refuses none of them."""
    found, shipped = schema(name), datasets.dataset_names(f"{name}s", ".toml")
    jsonschema.Draft202012Validator.check_schema(found)
    assert shipped
    for each in shipped:
        content = tomllib.loads(datasets.find_dataset(each, f"{name}s", ".toml").read_text(encoding="utf-8"))
        jsonschema.Draft202012Validator(found).validate(content)


def test_an_unknown_kind_lists_those_that_there_are():
    """By name."""
    with pytest.raises(RigError, match="'campaign' is no kind of input file: there are plan, rig, run-table"):
        schema("campaign")
