"""What the README shows runs as it stands there."""

import contextlib
import importlib
import io
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text("utf-8")


def test_the_example_in_python():
    """The conditions are printed as the comment behind them says, and two counter-masses."""
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "README.md", "exec"), {})
    (promised,) = re.findall(r"#\s*(mcx.*)", code)
    first, second = printed.getvalue().splitlines()
    assert first == promised
    assert second.count("CounterMass(") == 2


@pytest.mark.parametrize("step", sorted(path.stem for path in (ROOT / "demo").glob("*.py") if path.stem[0] != "_"))
def test_steps_of_the_demo_find_what_they_import(step):
    """Nothing that the packages moved: the demo itself takes minutes."""
    importlib.import_module(f"demo.{step}")
