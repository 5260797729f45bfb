"""Reading in a process of its own, where a library may crash, hang or swallow memory on a damaged file.

``frames`` is what goes through the pipe, numbers and JSON and never code; ``worker`` what runs in the process;
``process`` starts it, waits for it, and makes a refusal of whatever befalls it; ``parent`` makes a recording of what
it sends.
"""

from .parent import open_isolated

__all__ = ["open_isolated"]
