"""Quotes round cells: taken off where they enclose a whole cell, left where they do not, so that nothing is glued."""


def unquoted(text: bytes, delimiter: bytes, separator: bytes) -> bytes:
    """Rows with ``separator`` between cells and without the quotes that enclose cells.

    A row whose quotes are not in order stays as it is; it will not parse.
    """
    if b'"' not in text:
        return text.replace(delimiter, separator)
    parts = text.split(b'"')
    if _in_order(parts, delimiter):
        parts[::2] = [part.replace(delimiter, separator) for part in parts[::2]]
        return b"".join(parts)
    if text.count(b"\n") <= 1:
        return text
    return b"".join(unquoted(line, delimiter, separator) for line in text.splitlines(keepends=True))


def _in_order(parts: list[bytes], delimiter: bytes) -> bool:
    """Whether every other part, which is outside quotes, begins and ends at a border of cells."""
    outside, inside = set(parts[2:-1:2]), parts[1::2]
    return (
        len(parts) % 2 == 1
        and (not parts[0] or parts[0].endswith((delimiter, b"\n")))
        and parts[-1].startswith((delimiter, b"\n", b"\r"))
        and all(p.startswith((delimiter, b"\n", b"\r")) and p.endswith((delimiter, b"\n")) for p in outside)
        and b"\n" not in b"".join(inside)
    )
