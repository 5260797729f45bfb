"""Compiled loops: kept in the user's cache as machine code, each compiled once in a process of its own.

What is kept is code for this processor and has no link to numba, which need not be imported to run it. A kernel is a
module that imports numba and gives, by ``compiled()``, its loop as text that LLVM takes. It is compiled by
``python -m balance.compiled_kernels MODULE FILE``.
"""

import ctypes
import hashlib
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

PLACE, INTEGER, BYTE = ctypes.c_void_p, ctypes.c_int64, ctypes.c_uint8
"""Types of a loop's arguments: the address of an array, and numbers."""
_CODE_LIMIT = 20_000_000
"""Largest machine code of a loop [bytes]."""
_engines: list[Any] = []  # what holds the machine code that is in use
_one_compiles = threading.Lock()


@dataclass(frozen=True)
class Kernel:
    """A loop by the module that compiles it, the name of its entry, and its arguments."""

    module: str
    entry: str
    arguments: tuple[Any, ...]

    @property
    def source(self) -> Path:
        """The file of the module, found without importing it, in one of the packages of this distribution."""
        return Path(__file__).parent.parent.joinpath(*self.module.split(".")).with_suffix(".py")

    def loop(self, compiling: Callable[[], None] = lambda: None) -> Callable[..., int] | None:
        """The loop; None if it cannot be had here.

        Where it is not kept, or damaged, it is compiled: some seconds, in another process of the lowest priority;
        ``compiling`` is called before.
        """
        if sys.platform == "win32" or sys.byteorder != "little":
            return None  # words begin with the lowest byte; LLVM's loader of kept code is not to be had on Windows
        from .user_cache import cache_folder  # late: short logs are read without compiled code

        try:
            path = cache_folder() / f"{self.entry}-{self._state()}.o"
            if (kept := self.kept(path)) is not None:
                return kept
            compiling()
            with _one_compiles:  # of several logs that are read at once, all but one find it kept
                return self.kept(path) or self.compiled(path)
        except (ImportError, PackageNotFoundError, OSError, RuntimeError, ValueError):
            return None

    def compiled(self, path: Path) -> Callable[..., int] | None:
        """The loop compiled anew, and kept at ``path``."""
        import subprocess

        path.parent.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", __name__, self.module, str(path)]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
        return self.kept(path) if done.returncode == 0 else None

    def kept(self, path: Path) -> Callable[..., int] | None:
        """The loop that is kept at ``path``; None if there is none, or if it is damaged."""
        from llvmlite import binding

        from .user_cache import read_cached

        if (code := read_cached(path, _CODE_LIMIT)) is None:
            return None
        engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
        engine.add_object_file(binding.ObjectFileRef.from_data(code))
        engine.finalize_object()
        _engines.append(engine)
        return ctypes.CFUNCTYPE(INTEGER, *self.arguments)(engine.get_function_address(self.entry))

    def _state(self) -> str:
        """What the machine code depends on: its source, what compiles it, and the processor."""
        from llvmlite import binding

        parts = [binding.get_default_triple(), *_processor(), *(version(name) for name in ("llvmlite", "numba"))]
        return hashlib.sha256(self.source.read_bytes() + "\0".join(parts).encode()).hexdigest()[:16]


class Preparing:
    """The ``loop`` of a kernel, made ready in a thread; None until it is, and where it cannot be had.

    ``decided`` is set once it is there, or not to be waited for because it is compiled anew.
    """

    def __init__(self, kernel: Kernel) -> None:
        self.loop: Callable[..., int] | None = None
        self.decided = threading.Event()
        self.thread = threading.Thread(target=self._load, args=(kernel,), daemon=True)
        self.thread.start()

    def _load(self, kernel: Kernel) -> None:
        self.loop = kernel.loop(compiling=self.decided.set)
        self.decided.set()


def can_compile() -> bool:
    """Whether numba is installed (the extra ``compiled``); it is not imported."""
    return find_spec("numba") is not None


def compiled_by(njit: Any, signature: str, **options: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:  # noqa: ANN401
    """A decorator: the loop as numba's ``njit`` compiles it, kept where that can be; None leaves it as it is."""

    def compiled(function: Callable[..., None]) -> Callable[..., None]:
        if njit is None:
            return function
        loop: Callable[..., None]
        try:
            loop = njit(signature, nogil=True, cache=True, **options)(function)
        except (RuntimeError, OSError):  # an installation that cannot be written and no home, or a full disk
            loop = njit(signature, nogil=True, **options)(function)
        return loop

    return compiled


def _processor() -> tuple[str, str]:
    """Name and features of this machine's processor, as LLVM calls them."""
    from llvmlite import binding

    try:
        return binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    except RuntimeError:  # LLVM does not know the features
        return "", ""


def _machine() -> Any:  # noqa: ANN401
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = _processor()
    return binding.Target.from_default_triple().create_target_machine(name, features, opt=3, jit=True)


def keep(path: Path, text: str) -> None:
    """Compile what numba made of a loop to machine code, and keep it with its digest."""
    from llvmlite import binding

    from .user_cache import write_cached

    with suppress(AttributeError, OSError):
        os.nice(19)
    machine, module = _machine(), binding.parse_assembly(text)
    write_cached(path, machine.emit_object(module))


if __name__ == "__main__":
    from importlib import import_module

    keep(Path(sys.argv[2]), import_module(sys.argv[1]).compiled())
