"""The graphics device: which Vulkan adapters there are, which one is taken and why.

wgpu is imported inside functions: importing this module touches no device and loads no driver.
"""

from __future__ import annotations

import ctypes
import functools
import os
import re
import tempfile
import threading
import weakref
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from importlib import import_module
from typing import Any, TypedDict

from halfstep.device import loader as wgpu_loader
from halfstep.device.handles import GpuAdapter, GpuDevice, Info
from halfstep.errors import AdapterError, DeviceError

# How lavapipe, Mesa's Vulkan driver for the processor, names its adapter.
LAVAPIPE = "llvmpipe"
SWIFTSHADER = "SwiftShader"
SOFTWARE = (LAVAPIPE, SWIFTSHADER)
# Where browsers install SwiftShader. The Vulkan loader uses it only if a variable names it.
SWIFTSHADER_FILES = (
    "/usr/lib/chromium/vk_swiftshader_icd.json",  # Debian, Arch
    "/usr/lib64/chromium-browser/vk_swiftshader_icd.json",  # Fedora
    "/opt/google/chrome/vk_swiftshader_icd.json",
)

# wgpu reports a virtual GPU as type CPU, so a software renderer is known by its name.
PREFERENCE = ("discrete", "integrated", "virtual", "unknown", "cpu")
_KIND = {"DiscreteGPU": "discrete", "IntegratedGPU": "integrated", "CPU": "virtual"}

# Variables that decide which drivers and adapters are seen and taken.
VARIABLES = (
    "HALFSTEP_ADAPTER",
    "HALFSTEP_EXPECT_LAVAPIPE",
    "WGPUPY_WGPU_ADAPTER_NAME",
    "WGPU_BACKEND_TYPE",
    "WGPU_LIB_PATH",
    "VK_DRIVER_FILES",
    "VK_ICD_FILENAMES",
    "LP_NUM_THREADS",
)

# What HALFSTEP_EXPECT_LAVAPIPE may be, in any case.
_YES = ("1", "true", "yes")
_NO = ("", "0", "false", "no")

MESA = """\
  Debian, Ubuntu  sudo apt-get install mesa-vulkan-drivers
  Fedora          sudo dnf install mesa-vulkan-drivers vulkan-loader
  Arch            sudo pacman -S vulkan-swrast vulkan-icd-loader
  conda           conda install -c conda-forge mesalib libvulkan-loader"""
NO_ADAPTER = f"""\
no Vulkan adapter found
A graphics card needs its maker's driver; Mesa's needs no card:
{MESA}
Without a driver, the backend "numpy" renders the same picture slowly."""

INT64 = "shader-int64"
# wgpu's names of the features Halfstep uses where it can, with what they are.
FEATURES = {
    INT64: "64-bit integers in shaders",
    "shader-f16": "16-bit floats in shaders",
    "shader-f64": "64-bit floats in shaders",
    "mappable-primary-buffers": "frame buffers that the processor can read",
    "subgroup": "exchange between the invocations of a subgroup",
    "timestamp-query": "device times",
}

# The process that loads the drivers.
_process: int | None = None
_loading = threading.Lock()
# Every wgpu.GPUDevice of `open_device` that is in use.
_devices: weakref.WeakSet[GpuDevice] = weakref.WeakSet()


class Facts(TypedDict):
    """What a frame says of what rendered it."""

    adapter: str
    driver: str  # with its version


@dataclass(frozen=True)
class AdapterSummary:
    """What is known of an adapter without opening it."""

    index: int  # in the order wgpu lists Vulkan adapters
    name: str
    kind: str  # one of PREFERENCE
    driver: str  # name and version, as the driver tells them; may be empty
    vendor: str  # name, or PCI id where the driver gives none
    backend: str

    @property
    def facts(self) -> Facts:
        """Its name and its driver's."""
        return {"adapter": self.name, "driver": self.driver}

    def __str__(self) -> str:
        driver = f", {self.driver}" if self.driver else ""
        return f"{self.index}: {self.name} ({self.kind}{driver})"


@dataclass(frozen=True)
class Adapter:
    """A chosen adapter."""

    summary: AdapterSummary
    reason: str  # why this one, in words
    handle: GpuAdapter


def list_adapters() -> list[AdapterSummary]:
    """The Vulkan adapters of this machine, in wgpu's order; empty where there is none.

    Raises:
        AdapterError: wgpu itself cannot be loaded.
    """
    return [_summary(index, handle.info) for index, handle in enumerate(_handles())]


def choose_adapter(requested: str | int | None = None) -> Adapter:
    """The adapter to render on.

    Args:
        requested: an index of `list_adapters`, as a number or in digits, or a part of a name in
            any case. None leaves it to HALFSTEP_ADAPTER (the same), to WGPUPY_WGPU_ADAPTER_NAME
            (a part of the name in its case), else to the best kind present.

    Raises:
        AdapterError: there is no adapter, or none that was asked for.
    """
    adapters = list_adapters()
    summary, reason = select_adapter(adapters, requested, os.environ)
    return Adapter(summary, reason, _handles()[summary.index])


def select_adapter(
    adapters: Sequence[AdapterSummary],
    requested: str | int | None,
    environ: Mapping[str, str],
) -> tuple[AdapterSummary, str]:
    """The choice of `choose_adapter` among ``adapters``, with its reason.

    Raises:
        AdapterError: as `choose_adapter`.
    """
    backend = environ.get("WGPU_BACKEND_TYPE", "").strip()
    if backend not in ("", "Vulkan"):
        raise AdapterError(f"WGPU_BACKEND_TYPE={backend}: Halfstep renders on Vulkan only")
    candidates = list(adapters)
    only_lavapipe = _expects_lavapipe(environ)
    if only_lavapipe:
        candidates = [adapter for adapter in adapters if is_lavapipe(adapter)]
        if not candidates:
            raise AdapterError(
                f"HALFSTEP_EXPECT_LAVAPIPE={environ['HALFSTEP_EXPECT_LAVAPIPE']}: no lavapipe; "
                f"Mesa's driver brings it:\n{MESA}"
            )
    if not candidates:
        raise AdapterError(NO_ADAPTER)

    request, source = _request(requested, environ)
    if request is not None:
        ignore_case = source != "WGPUPY_WGPU_ADAPTER_NAME"
        matching = _matching(candidates, request, ignore_case=ignore_case)
        if not matching:
            raise AdapterError(f"{source} {request!r}: no such adapter" + _seen(candidates))
        rest = f", the first of {len(matching)} that match" if len(matching) > 1 else ""
        return matching[0], f"{source} {request!r}{rest}"
    if only_lavapipe:
        return candidates[0], f"HALFSTEP_EXPECT_LAVAPIPE={environ['HALFSTEP_EXPECT_LAVAPIPE']}"
    if len(candidates) == 1:
        return candidates[0], "the only adapter"
    best = min(candidates, key=lambda adapter: PREFERENCE.index(adapter.kind))
    return best, f"the first of kind {best.kind}; the order is {', '.join(PREFERENCE)}"


def is_requested(requested: str | int | None = None) -> bool:
    """Whether a certain adapter is asked for: `choose_adapter` then gives that one or none."""
    is_named = _request(requested, os.environ)[0] is not None
    return is_named or _expected(os.environ) not in _NO


def is_lavapipe(adapter: AdapterSummary) -> bool:
    """Whether ``adapter`` is lavapipe's."""
    return adapter.kind == "cpu" and adapter.name.startswith(LAVAPIPE)


def open_device(adapter: Adapter, *, features: Collection[str] = ()) -> GpuDevice:
    """A wgpu.GPUDevice on ``adapter`` with ``features``, and timestamps where the adapter has them.

    Buffers and bindings may be as large as the adapter allows: ``limits`` of the device.

    Raises:
        AdapterError: the adapter lacks one of ``features``.
        DeviceError: the driver refuses to open the device.
    """
    offered = adapter.handle.features
    missing = sorted(set(features) - offered)
    if missing:
        lacks = ", ".join(f"{name} ({FEATURES[name]})" for name in missing)
        raise AdapterError(f"adapter {adapter.summary} has no {lacks}" + _seen(list_adapters()))
    with device_errors(adapter):
        # With no limits named, wgpu-py asks for the adapter's own.
        device = adapter.handle.request_device_sync(
            label="halfstep",
            required_features=sorted({*features, *({"timestamp-query"} & offered)}),
        )
    _devices.add(device)
    return device


def close_device(device: GpuDevice) -> None:
    """Give back the memory and the threads of a wgpu.GPUDevice; nothing may use it any more.

    What was made on it is to be let go of before: each such object keeps the device.
    """
    handle: Any = device
    queue = handle.queue
    device.destroy()
    # In wgpu-py the device refers to itself, and its queue to it. Until Python looks for such
    # cycles, which may be hundreds of devices later, the driver would keep all that it has.
    handle._device = queue._device = None  # noqa: SLF001 - wgpu has no way to say it


@contextmanager
def device_errors(adapter: Adapter) -> Iterator[None]:
    """Turn what wgpu raises into DeviceError; only calls of wgpu belong inside.

    wgpu reports a lost device as a validation error and a failed mapping as a RuntimeError, so
    every error of it means that this device did not do its work.

    Raises:
        DeviceError: any error of wgpu, with its message.
    """
    with wgpu_errors(f"adapter {adapter.summary}"):
        yield


@contextmanager
def wgpu_errors(label: str) -> Iterator[None]:
    """`device_errors` where there is a device, but no `Adapter`; ``label`` begins the message.

    Raises:
        DeviceError: any error of wgpu, with its message.
    """
    import wgpu

    try:
        yield
    except (wgpu.GPUError, wgpu.GPUPipelineError, RuntimeError) as error:
        raise DeviceError(f"{label}: {error}") from error


def stack_of(device: GpuDevice) -> dict[str, str]:
    """What a wgpu.GPUDevice stands on: adapter and driver by name, and versions of the parts.

    Keys: ``adapter``, ``driver``, ``mesa`` and ``llvm`` (where the driver tells them), ``wgpu``,
    ``wgpu_native``.
    """
    info = device.adapter_info
    told = f"{info['description']} {info['device']}"
    # A package may stand in for wgpu, as wgpudawn does.
    package = type(device).__module__.partition(".")[0]
    parts = versions()
    if package != "wgpu":
        parts = {"wgpu": f"{parts['wgpu']} as of {package}", "wgpu_native": "absent"}
    found = {
        name: re.search(rf"{name} (\d[\w.-]*)", told, re.IGNORECASE) for name in ("mesa", "llvm")
    }
    return {
        "adapter": info["device"],
        "driver": _driver(info),
        **{name: match[1] for name, match in found.items() if match},
        **parts,
    }


def versions() -> dict[str, str]:
    """Versions of ``wgpu`` and of ``wgpu_native``, the library beneath it."""
    import wgpu

    # A module that stands in for wgpu has no such attribute of the package.
    native = import_module("wgpu.backends.wgpu_native")
    return {
        "wgpu": wgpu.__version__,
        "wgpu_native": ".".join(map(str, native.lib_version_info)),
    }


def describe() -> dict[str, Any]:
    """Adapters, the choice and its reason, and the variables that decide: `halfstep doctor`.

    Keys: ``adapters`` (list of dicts), ``chosen`` (index or None), ``reason``, ``features`` of
    the chosen adapter (list), ``environment`` (dict), ``swiftshader`` (the file of a driver that
    lies here and is not among the adapters, or None), ``wgpu`` and ``wgpu_native`` (versions).
    With no choice ``reason`` is the message of the AdapterError.

    Raises:
        AdapterError: wgpu itself cannot be loaded.
    """
    adapters = list_adapters()
    report: dict[str, Any] = {
        "adapters": [asdict(adapter) for adapter in adapters],
        "chosen": None,
        "features": [],
        "environment": {name: os.environ[name] for name in VARIABLES if name in os.environ},
        "swiftshader": _swiftshader_file(adapters),
        **versions(),
    }
    try:
        chosen = choose_adapter()
    except AdapterError as error:
        return report | {"reason": str(error)}
    features = sorted(set(FEATURES) & chosen.handle.features)
    return report | {
        "chosen": chosen.summary.index,
        "reason": chosen.reason,
        "features": features,
    }


def is_forked() -> bool:
    """Whether this process was forked from one that had loaded the drivers.

    Their threads are not here, and the first call of one would wait for them for ever.
    """
    return _process not in (None, os.getpid())


def check_process() -> None:
    """See that the drivers can be used in this process.

    Raises:
        DeviceError: `is_forked`.
    """
    if is_forked():
        raise DeviceError(
            "this process was forked from one that uses a graphics driver, which does not survive "
            'it; start processes with multiprocessing.get_context("spawn")'
        )


def _expected(environ: Mapping[str, str]) -> str:
    return environ.get("HALFSTEP_EXPECT_LAVAPIPE", "").strip().casefold()


def _expects_lavapipe(environ: Mapping[str, str]) -> bool:
    """Whether only lavapipe will do.

    Raises:
        AdapterError: the variable is neither a yes nor a no.
    """
    if _expected(environ) not in _YES + _NO:
        raise AdapterError(
            f"HALFSTEP_EXPECT_LAVAPIPE={environ['HALFSTEP_EXPECT_LAVAPIPE']}: neither a yes "
            f"({', '.join(_YES)}) nor a no ({', '.join(_NO[1:])}, or nothing)"
        )
    return _expected(environ) in _YES


def _swiftshader_file(adapters: Sequence[AdapterSummary]) -> str | None:
    """The file of a SwiftShader that is here and none of ``adapters``."""
    if any(adapter.name.startswith(SWIFTSHADER) for adapter in adapters):
        return None
    return next(filter(os.path.exists, SWIFTSHADER_FILES), None)


def _request(requested: str | int | None, environ: Mapping[str, str]) -> tuple[str | None, str]:
    """What adapter is asked for, and by what."""
    if requested is not None:
        return str(requested), "adapter"
    for name in ("HALFSTEP_ADAPTER", "WGPUPY_WGPU_ADAPTER_NAME"):
        if environ.get(name):
            return environ[name], name
    return None, ""


def _matching(
    adapters: Sequence[AdapterSummary], request: str, *, ignore_case: bool
) -> list[AdapterSummary]:
    """Adapters with the index ``request``, where it is a number, else with it in their name.

    Two identical cards differ only by index. A number is never looked for in names, where it
    would be found in version numbers.
    """
    if re.fullmatch(r"-?\d+", request):
        return [adapter for adapter in adapters if adapter.index == int(request)]
    if ignore_case:
        return [adapter for adapter in adapters if request.casefold() in adapter.name.casefold()]
    return [adapter for adapter in adapters if request in adapter.name]


def _seen(adapters: Sequence[AdapterSummary]) -> str:
    """The end of a message: the adapters there are."""
    return "; the adapters are" + "".join(f"\n  {adapter}" for adapter in adapters)


def _summary(index: int, info: Info) -> AdapterSummary:
    name = info["device"]
    kind = _KIND.get(info["adapter_type"], "unknown")
    if name.startswith(SOFTWARE):
        kind = "cpu"
    return AdapterSummary(
        index=index,
        name=name,
        kind=kind,
        driver=_driver(info),
        vendor=info["vendor"] or f"0x{info['vendor_id']:04x}",
        backend=info["backend_type"],
        # wgpu-py 0.32 spells the name so.
    )


def _driver(info: Info) -> str:
    """Name and version of a driver; SwiftShader tells its name alone, as Vulkan's driverName."""
    driver: str = info["description"] or info["vendor"]
    return driver


def _handles() -> tuple[GpuAdapter, ...]:
    """wgpu.GPUAdapter of every Vulkan adapter.

    Raises:
        AdapterError: wgpu itself cannot be loaded.
        DeviceError: as `check_process`.
    """
    check_process()
    with _loading:
        return _loaded()


@functools.cache
def _loaded() -> tuple[GpuAdapter, ...]:
    """`_handles`, once; loads the drivers."""
    global _process
    _process = os.getpid()
    try:
        wgpu = wgpu_loader.load()
        from wgpu.backends.wgpu_native import extras
    except (ImportError, OSError, RuntimeError) as error:
        _process = None
        raise AdapterError(f"wgpu cannot be loaded: {error}") from error
    with _runtime_directory():
        # Otherwise wgpu loads OpenGL's drivers as well and lists lavapipe twice. A program that has
        # used wgpu before keeps its own settings.
        with suppress(RuntimeError):
            extras.set_instance_extras(backends=["Vulkan"])
        handles = wgpu.gpu.enumerate_adapters_sync()
    return tuple(handle for handle in handles if handle.info["backend_type"] == "Vulkan")


def _leave_to_parent() -> None:
    """In a forked child, let the devices be those of its parent.

    To destroy one, which Python would do with an object that nobody refers to, is to wait for
    threads of the driver that are not here.
    """
    global _loading
    _loading = threading.Lock()  # a thread that is not here may have it
    for device in _devices:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(device))
    if is_forked():
        _leave_out_exit_handlers()


def _leave_out_exit_handlers() -> None:
    """Let this process, a forked child, end without the exit handlers of its parent's drivers.

    That of Mesa 26 waits for threads of the driver that are not here. Handlers run in reverse
    order: those that the child registers still run, and then these, of which the second ends it.
    """
    libc = ctypes.CDLL(None)
    if hasattr(libc, "on_exit"):  # of glibc alone; it hands on the exit code
        libc.on_exit(libc["_exit"], None)
        libc.on_exit(libc.fcloseall, None)


os.register_at_fork(after_in_child=_leave_to_parent)


@contextmanager
def _runtime_directory() -> Iterator[None]:
    """Let XDG_RUNTIME_DIR be set.

    Listing adapters asks for a Wayland display, which complains on stderr where it is not set, as
    in containers and on servers.
    """
    if os.environ.get("XDG_RUNTIME_DIR"):
        yield
        return
    with tempfile.TemporaryDirectory(prefix="halfstep-") as directory:
        os.environ["XDG_RUNTIME_DIR"] = directory
        try:
            yield
        finally:
            os.environ.pop("XDG_RUNTIME_DIR", None)
