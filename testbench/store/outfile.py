"""The file below HDF5 while a run is written.

HDF5 crashes the process when it cannot write out what it holds, as on a full disk. Here a write that fails is kept as
``error`` and those after it are dropped, so that HDF5 closes in good order and the caller raises.
"""

import io
from pathlib import Path
from typing import Any


class OutFile(io.RawIOBase):
    """A new file that HDF5 writes through, whose first error is kept."""

    def __init__(self, path: Path) -> None:
        self._stream = path.open("x+b", buffering=0)
        self._at = 0
        self.error: OSError | None = None
        self.last = (0, 0)
        """Place and size of what was written last [bytes]."""

    def check(self) -> None:
        """Raise what went wrong, if anything did."""
        if self.error is not None:
            raise self.error

    def write(self, content: Any) -> int:  # noqa: ANN401
        """Write all of ``content``, or keep the reason why not."""
        view = memoryview(content).cast("B")
        done = 0
        try:
            while self.error is None and done < len(view):
                done += self._stream.write(view[done:])
        except OSError as error:
            self.error = error
        self.last = (self._at, len(view))
        self._at += len(view)
        return len(view)

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401
        """Read into ``buffer``; zeros where a write was dropped."""
        view = memoryview(buffer).cast("B")
        done = 0
        while done < len(view) and (count := self._stream.readinto(view[done:])):
            done += count
        view[done:] = bytes(len(view) - done)
        self._at = self._stream.tell()
        return len(view)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to a place in the file."""
        self._at = self._stream.seek(offset, whence)
        return self._at

    def tell(self) -> int:
        """The place in the file."""
        return self._stream.tell()

    def truncate(self, size: int | None = None) -> int:
        """Set the file's size, or keep the reason why not."""
        try:
            return self._stream.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def flush(self) -> None:
        """Nothing waits here."""

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self._stream.close()
        super().close()
