"""Every exception that a user of Halfstep meets, with the exit code of the command."""

from typing import ClassVar


class HalfstepError(Exception):
    """The base of all Halfstep errors, also raised itself for failures of no other kind."""

    exit_code: ClassVar[int] = 1


class SceneError(HalfstepError):
    """A scene, or an option that replaces a part of it, breaks a rule.

    Attributes:
        faults: every fault, one line each: ``figure.toml: solid[2].radius: -1 is not > 0``.
    """

    exit_code: ClassVar[int] = 2

    def __init__(self, *faults: str) -> None:
        super().__init__(*faults)
        self.faults: tuple[str, ...] = faults

    def __str__(self) -> str:
        return "\n".join(self.faults)


class UsageError(HalfstepError):
    """An argument of a function or of the command line cannot be used."""

    exit_code: ClassVar[int] = 2


class AdapterError(HalfstepError):
    """No suitable graphics adapter was found."""

    exit_code: ClassVar[int] = 3


class DeviceError(HalfstepError):
    """The device was lost, or its driver failed."""

    exit_code: ClassVar[int] = 4
