"""``balance`` with words, in this process."""

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from balance.cli import main

from ...commands import Outcome
from ...commands import call as call_main

call = partial(call_main, main, "balance")


def json_of(*words: object) -> Any:
    """The JSON document of a call that ends well."""
    done = call(*words, "--json")
    assert done.code == 0, done.err
    return done.json


@pytest.fixture
def balance() -> Callable[..., Outcome]:
    """Call ``balance`` with words."""
    return call
