"""Every exception a user of Halfstep meets, each with the exit code of its command."""

from typing import ClassVar


class HalfstepError(Exception):
    """Base of all Halfstep errors; a failed render or a conformance mismatch."""

    exit_code: ClassVar[int] = 1


class SceneError(HalfstepError):
    """A scene, or an option overriding part of it, breaks the rules.

    Attributes:
        faults: every fault found, one line each: ``figure.toml: solid[2].radius: -1 is not > 0``.
    """

    exit_code: ClassVar[int] = 2

    def __init__(self, *faults: str) -> None:
        super().__init__(*faults)
        self.faults: tuple[str, ...] = faults

    def __str__(self) -> str:
        return "\n".join(self.faults)


class UsageError(HalfstepError):
    """An argument of a function or of the command line that cannot be used."""

    exit_code: ClassVar[int] = 2


class AdapterError(HalfstepError):
    """No suitable graphics adapter was found."""

    exit_code: ClassVar[int] = 3


class DeviceError(HalfstepError):
    """The device was lost, or its driver failed."""

    exit_code: ClassVar[int] = 4
