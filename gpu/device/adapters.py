"""The Vulkan adapters of this machine, the choice of one with its reason, and its open device.

Functions import wgpu: importing this module touches no device and loads no driver.
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

# lavapipe, Mesa's Vulkan driver for the processor, names its adapter after its rasteriser.
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

# Environment variables that decide which drivers and adapters are listed and chosen.
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

# The values of HALFSTEP_EXPECT_LAVAPIPE, in upper or lower case.
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
# Optional features that Halfstep uses, by wgpu's name, with their meaning.
FEATURES = {
    INT64: "64-bit integers in shaders",
    "shader-f16": "16-bit floats in shaders",
    "shader-f64": "64-bit floats in shaders",
    "mappable-primary-buffers": "frame buffers that the processor can read",
    "subgroup": "exchange between the invocations of a subgroup",
    "timestamp-query": "device times",
}

# The id of the process that loaded the drivers.
_process: int | None = None
_loading = threading.Lock()
# Every wgpu.GPUDevice that `open_device` gave and that is still in use.
_devices: weakref.WeakSet[GpuDevice] = weakref.WeakSet()


class Facts(TypedDict):
    """The adapter and driver that rendered a frame, by name."""

    adapter: str
    driver: str  # with its version


@dataclass(frozen=True)
class AdapterSummary:
    """Facts about an adapter that need no open device."""

    index: int  # in the order wgpu lists Vulkan adapters
    name: str
    kind: str  # one of PREFERENCE
    driver: str  # name and version that the driver reports; may be empty
    vendor: str  # name, or the PCI id if the driver reports no name
    backend: str

    @property
    def facts(self) -> Facts:
        """The names of the adapter and of its driver."""
        return {"adapter": self.name, "driver": self.driver}

    def __str__(self) -> str:
        driver = f", {self.driver}" if self.driver else ""
        return f"{self.index}: {self.name} ({self.kind}{driver})"


@dataclass(frozen=True)
class Adapter:
    """A chosen adapter."""

    summary: AdapterSummary
    reason: str  # why this adapter was chosen, in words
    handle: GpuAdapter


def list_adapters() -> list[AdapterSummary]:
    """The Vulkan adapters of this machine, in wgpu's order; an empty list if it has none.

    Raises:
        AdapterError: wgpu itself cannot be loaded.
    """
    return [_summary(index, handle.info) for index, handle in enumerate(_handles())]


def choose_adapter(requested: str | int | None = None) -> Adapter:
    """Choose the adapter to render on.

    Args:
        requested: an index of `list_adapters`, as a number or in digits, or a part of a name,
            whose case does not matter. If None, HALFSTEP_ADAPTER decides in the same way, then
            WGPUPY_WGPU_ADAPTER_NAME (a part of a name, in the right case), then the order of kinds
            in PREFERENCE.

    Raises:
        AdapterError: the machine has no adapter or not the requested one, or a variable has a value
            that Halfstep cannot use.
    """
    adapters = list_adapters()
    summary, reason = select_adapter(adapters, requested, os.environ)
    return Adapter(summary, reason, _handles()[summary.index])


def select_adapter(
    adapters: Sequence[AdapterSummary],
    requested: str | int | None,
    environ: Mapping[str, str],
) -> tuple[AdapterSummary, str]:
    """The adapter of ``adapters`` that `choose_adapter` takes, and the reason in words.

    Raises:
        AdapterError: see `choose_adapter`.
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
    """Whether a certain adapter is requested, so that `choose_adapter` gives that one or fails."""
    is_named = _request(requested, os.environ)[0] is not None
    return is_named or _expected(os.environ) not in _NO


def is_lavapipe(adapter: AdapterSummary) -> bool:
    """Whether lavapipe drives ``adapter``."""
    return adapter.kind == "cpu" and adapter.name.startswith(LAVAPIPE)


def open_device(adapter: Adapter, *, features: Collection[str] = ()) -> GpuDevice:
    """Open a wgpu.GPUDevice on ``adapter`` with ``features``, and timestamps if it has them.

    The device's ``limits`` are the adapter's, so buffers and bindings may be as large as it allows.

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
        # If no limits are named, wgpu-py requests the adapter's own.
        device = adapter.handle.request_device_sync(
            label="halfstep",
            required_features=sorted({*features, *({"timestamp-query"} & offered)}),
        )
    _devices.add(device)
    return device


def close_device(device: GpuDevice) -> None:
    """Give back the memory and the threads of a wgpu.GPUDevice. Nothing may use it afterwards.

    Release the device's buffers and pipelines first: each of them keeps the device.
    """
    handle: Any = device
    queue = handle.queue
    device.destroy()
    # In wgpu-py the device refers to itself, and its queue to the device. The driver would keep
    # memory and threads until Python collects such cycles, maybe hundreds of devices later.
    handle._device = queue._device = None  # noqa: SLF001 - wgpu has no public way to do this


@contextmanager
def device_errors(adapter: Adapter) -> Iterator[None]:
    """Turn every error of wgpu into a DeviceError. Only calls of wgpu belong inside.

    wgpu reports a lost device as a validation error and a failed mapping as a RuntimeError, so
    every error of wgpu means that the device did not do its work.

    Raises:
        DeviceError: any error of wgpu, with its message.
    """
    with wgpu_errors(f"adapter {adapter.summary}"):
        yield


@contextmanager
def wgpu_errors(label: str) -> Iterator[None]:
    """`device_errors` for code that has no `Adapter`; ``label`` begins the message.

    Raises:
        DeviceError: any error of wgpu, with its message.
    """
    import wgpu

    try:
        yield
    except (wgpu.GPUError, wgpu.GPUPipelineError, RuntimeError) as error:
        raise DeviceError(f"{label}: {error}") from error


def stack_of(device: GpuDevice) -> dict[str, str]:
    """The stack below a wgpu.GPUDevice: names of adapter and driver, versions of the libraries.

    Keys: ``adapter``, ``driver``, ``mesa`` and ``llvm`` (if the driver reports them), ``wgpu``,
    ``wgpu_native``.
    """
    info = device.adapter_info
    told = f"{info['description']} {info['device']}"
    # Another package may replace wgpu, as wgpudawn does.
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
    """Versions of ``wgpu`` and of ``wgpu_native``, the library below it."""
    import wgpu

    # Import by name: a package that replaces wgpu may not have ``backends`` as an attribute.
    native = import_module("wgpu.backends.wgpu_native")
    return {
        "wgpu": wgpu.__version__,
        "wgpu_native": ".".join(map(str, native.lib_version_info)),
    }


def describe() -> dict[str, Any]:
    """The report of `halfstep doctor`: adapters, the choice and its reason, and the variables.

    Keys: ``adapters`` (list of dicts), ``chosen`` (index or None), ``reason``, ``features`` of
    the chosen adapter (list), ``environment`` (dict), ``swiftshader`` (the file of an installed
    SwiftShader that is not among the adapters, or None), ``wgpu`` and ``wgpu_native`` (versions).
    If no adapter is chosen, ``reason`` is the message of the AdapterError.

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
    """Whether this process was forked from a process that had loaded the drivers.

    A fork does not copy the drivers' threads. The first call of a driver would wait for them
    forever.
    """
    return _process not in (None, os.getpid())


def check_process() -> None:
    """Check that this process can use the drivers.

    Raises:
        DeviceError: `is_forked` is true.
    """
    if is_forked():
        raise DeviceError(
            "this process was forked from one that uses a graphics driver, which does not survive "
            'it; start processes with multiprocessing.get_context("spawn")'
        )


def _expected(environ: Mapping[str, str]) -> str:
    return environ.get("HALFSTEP_EXPECT_LAVAPIPE", "").strip().casefold()


def _expects_lavapipe(environ: Mapping[str, str]) -> bool:
    """Whether HALFSTEP_EXPECT_LAVAPIPE allows only lavapipe.

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
    """The driver file of an installed SwiftShader that is not among ``adapters``."""
    if any(adapter.name.startswith(SWIFTSHADER) for adapter in adapters):
        return None
    return next(filter(os.path.exists, SWIFTSHADER_FILES), None)


def _request(requested: str | int | None, environ: Mapping[str, str]) -> tuple[str | None, str]:
    """The requested adapter or None, and the name of the argument or variable that requests it."""
    if requested is not None:
        return str(requested), "adapter"
    for name in ("HALFSTEP_ADAPTER", "WGPUPY_WGPU_ADAPTER_NAME"):
        if environ.get(name):
            return environ[name], name
    return None, ""


def _matching(
    adapters: Sequence[AdapterSummary], request: str, *, ignore_case: bool
) -> list[AdapterSummary]:
    """The adapters with the index ``request`` if it is a number, else those with it in the name.

    Two identical cards differ only by index. A number never matches a name, because names contain
    version numbers.
    """
    if re.fullmatch(r"-?\d+", request):
        return [adapter for adapter in adapters if adapter.index == int(request)]
    if ignore_case:
        return [adapter for adapter in adapters if request.casefold() in adapter.name.casefold()]
    return [adapter for adapter in adapters if request in adapter.name]


def _seen(adapters: Sequence[AdapterSummary]) -> str:
    """The end of a message: a list of ``adapters``."""
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
    )


def _driver(info: Info) -> str:
    """Name and version of a driver. SwiftShader reports only a name, in Vulkan's driverName."""
    driver: str = info["description"] or info["vendor"]
    return driver


def _handles() -> tuple[GpuAdapter, ...]:
    """The wgpu.GPUAdapter of every Vulkan adapter.

    Raises:
        AdapterError: wgpu itself cannot be loaded.
        DeviceError: `is_forked` is true.
    """
    check_process()
    with _loading:
        return _loaded()


@functools.cache
def _loaded() -> tuple[GpuAdapter, ...]:
    """Load the drivers, once, and list the adapters for `_handles`."""
    global _process
    _process = os.getpid()
    try:
        wgpu = wgpu_loader.load()
        from wgpu.backends.wgpu_native import extras
    except (ImportError, OSError, RuntimeError) as error:
        _process = None
        raise AdapterError(f"wgpu cannot be loaded: {error}") from error
    with _runtime_directory():
        # Without this, wgpu also loads OpenGL's drivers and lists lavapipe twice. wgpu refuses new
        # settings in a program that has used it before; such a program keeps its own.
        with suppress(RuntimeError):
            extras.set_instance_extras(backends=["Vulkan"])
        handles = wgpu.gpu.enumerate_adapters_sync()
    return tuple(handle for handle in handles if handle.info["backend_type"] == "Vulkan")


def _leave_to_parent() -> None:
    """In a forked child, leave the devices to the parent.

    Python destroys a device that nobody refers to. In the child this would wait forever for the
    driver's threads, which a fork does not copy. One more reference keeps each device alive.
    """
    global _loading
    _loading = threading.Lock()  # a thread of the parent may hold the old one
    for device in _devices:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(device))
    if is_forked():
        _leave_out_exit_handlers()


def _leave_out_exit_handlers() -> None:
    """Let this forked child end without running the exit handlers of its parent's drivers.

    The exit handler of Mesa 26 waits for the driver's threads, which a fork does not copy. Handlers
    run in reverse order: first those that the child registers later, then `fcloseall`, then
    `_exit`, which ends the process before the parent's handlers run.
    """
    libc = ctypes.CDLL(None)
    if hasattr(libc, "on_exit"):  # glibc only; it passes on the exit code
        libc.on_exit(libc["_exit"], None)
        libc.on_exit(libc.fcloseall, None)


os.register_at_fork(after_in_child=_leave_to_parent)


@contextmanager
def _runtime_directory() -> Iterator[None]:
    """Set XDG_RUNTIME_DIR to an empty folder if it is not set.

    Listing adapters looks for a Wayland display. Without the variable, as in containers and on
    servers, Wayland writes an error to stderr.
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
