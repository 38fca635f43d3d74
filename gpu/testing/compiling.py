"""Messages of the compiler, with files and lines of the source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import methodcaller

from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.module import Module

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)


@dataclass(frozen=True)
class Located:
    """A context in which messages of the compiler get the files and lines of the source.

    Attributes:
        module: the source.
        function: the function that the kit's own ``entry_point`` calls, if there is one.
    """

    module: Module
    entry_point: str = ""
    function: str = ""

    def __enter__(self) -> None:
        pass

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if isinstance(error, UsageError):
            told = self.module.relocated(str(error))
            if self.entry_point:
                told = told.replace(self.entry_point, self.function)
            raise UsageError(told) from None


@dataclass(frozen=True)
class CompilerFirst:
    """A context in which the compiler reports a text that cannot be read; its message is better."""

    compile: Callable[[Module], None]
    module: Module

    def __enter__(self) -> None:
        pass

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if isinstance(error, UsageError | RecursionError):
            self.compile(self.module)
        if isinstance(error, RecursionError):
            raise UsageError(
                f"{self.module.name}: a type or a constant is nested too deeply"
            ) from None
