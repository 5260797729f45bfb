"""What the tests of texts share: a text that becomes a log, read to its end."""

import pytest

from .. import reading


@pytest.fixture
def log(tmp_path):
    """Write a text or bytes as a log and read it to its end."""

    def write_and_read(content, options=None):
        path = tmp_path / "log.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return reading.read(path, options)

    return write_and_read
