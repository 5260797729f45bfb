"""The conda recipe says what pyproject.toml says; what is vendored is stated with its licence."""

import json
import re
import tomllib
from hashlib import sha256

import yaml

from .source_trees import PACKAGES, ROOT

CONDA_NAMES = {
    "pin": "pinocchio", "matplotlib": "matplotlib-base", "mujoco-core": "mujoco-python", "xxhash": "python-xxhash",
}  # fmt: skip
"""What conda-forge calls otherwise than the package index."""
RECIPE = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text("utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


def conda(requirement: str) -> str:
    """A requirement of the package index as conda writes it; conda has Pinocchio for every system."""
    name, versions = re.fullmatch(r"([\w.-]+)([^;]*)(?:;.*)?", requirement).groups()
    return f"{CONDA_NAMES.get(name, name)} {versions.strip()}"


def test_the_recipe_is_the_projects():
    """Version, dependencies, Python, what builds it, commands, summary and licences."""
    project = PROJECT["project"]
    python = f"python {project['requires-python']}"
    assert RECIPE["context"]["version"] == project["version"]
    assert RECIPE["requirements"]["run"] == [python, *map(conda, project["dependencies"])]
    assert RECIPE["requirements"]["host"] == [python, "pip", *map(conda, PROJECT["build-system"]["requires"])]
    scripts = [f"{name} = {place}" for name, place in project["scripts"].items()]
    assert RECIPE["build"]["python"]["entry_points"] == scripts
    assert RECIPE["about"]["summary"] == project["description"]
    assert RECIPE["about"]["license"] == project["license"]
    assert RECIPE["about"]["license_file"] == project["license-files"]


def test_what_is_vendored_is_stated():
    """Each file that is not ours by its digest, in the bill of materials beside it, with a licence that is shipped."""
    folder = ROOT / "balance" / "report" / "vendor"
    assert [path.parent for package in PACKAGES for path in (ROOT / package).rglob("LICENSE*")] == [folder]
    stated = json.loads((folder / "vendored.cdx.json").read_text("utf-8"))["components"]
    digests = {file["name"]: file["hashes"][0]["content"] for part in stated for file in part["components"]}
    ours = {"vendored.cdx.json", *(f"LICENSE.{part['name']}" for part in stated)}
    assert digests == {
        path.name: sha256(path.read_bytes()).hexdigest() for path in folder.iterdir() if path.name not in ours
    }
    for part in stated:
        assert f"balance/report/vendor/LICENSE.{part['name']}" in PROJECT["project"]["license-files"]
        assert f"(v{part['version']})" in (folder / f"{part['name']}.iife.min.js").read_text("utf-8")[:200]
