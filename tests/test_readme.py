"""What the README shows runs as it stands there."""

import contextlib
import io
import re
from pathlib import Path

TEXT = (Path(__file__).parents[1] / "README.md").read_text("utf-8")


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
