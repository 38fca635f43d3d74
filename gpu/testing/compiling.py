"""What the compiler says, at its time and with the places of the source."""

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
    """Tells what the compiler says with the files and lines of the source.

    Attributes:
        module: the source.
        function: what an ``entry_point`` that is not of the source calls, if there is one.
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
    """Lets the compiler speak first where a text cannot be read: it says better what is wrong."""

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
