"""What is wrong with a file, by key: pydantic's errors in the words of this package."""

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

KeyPath = tuple[str | int, ...]


def explain(source: str, error: "ValidationError", table_of: Callable[[KeyPath], "type[BaseModel]"]) -> str:
    """All errors, one a line: the file, the key, what was found, what was expected."""
    lines = [f"{_key(e)}: {_message(e, table_of)}" for e in error.errors(include_url=False)]
    return "\n".join(f"{source}: {line}" for line in dict.fromkeys(lines))


def suggestion(word: str, known: Iterable[str]) -> str:
    """``; did you mean 'rate'?`` if a known word is near."""
    near = get_close_matches(word, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def _key(error: Any) -> str:  # noqa: ANN401
    """``sensors.base_acc.range``: without the kind that pydantic puts among the keys of a sensor."""
    parts = [str(part) for part in error["loc"] if part != "[key]"]
    while parts and parts[-1].isdecimal():
        parts.pop()  # which of three axes: the message has the value
    if (
        parts[:1] == ["sensors"]
        and len(parts) > 2
        and error["type"] not in {"union_tag_invalid", "union_tag_not_found"}
    ):
        del parts[2]
    if error["type"] in {"union_tag_invalid", "union_tag_not_found"}:
        parts.append("kind")
    return ".".join(parts) or "file"


def _message(error: Any, table_of: Callable[[KeyPath], "type[BaseModel]"]) -> str:  # noqa: ANN401
    kind, found, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind == "missing":
        return "missing" if isinstance(error["loc"][-1], str) else "expected three values, for x, y and z"
    if kind == "extra_forbidden":
        known = list(table_of(error["loc"][:-1]).model_fields)
        hint = suggestion(str(error["loc"][-1]), known)
        return f"unknown key{hint or ': expected ' + ', '.join(known)}"
    if kind == "union_tag_not_found":
        return "missing: it says what the sensor is"
    if kind == "union_tag_invalid":
        return f"{context['tag']!r}: expected {context['expected_tags']}{suggestion(context['tag'], _tags(context))}"
    if kind == "literal_error":
        return f"{found!r}: expected {context['expected']}"
    shown = f"{found!r}: " if isinstance(found, str | int | float) else ""
    return f"{shown}{error['msg'][0].lower()}{error['msg'][1:]}"


def _tags(context: dict[str, str]) -> list[str]:
    return [tag.strip(" '") for tag in context["expected_tags"].split(",")]
