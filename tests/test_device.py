"""Which adapter is taken and why; what is said when there is none."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from halfstep.device import adapters as device
from halfstep.device.adapters import (
    Adapter,
    AdapterSummary,
    device_errors,
    open_device,
    select_adapter,
)
from halfstep.device.handles import GpuAdapter, Info
from halfstep.errors import AdapterError, DeviceError

LAVAPIPE = AdapterSummary(
    index=0,
    name="llvmpipe (LLVM 15.0.6, 256 bits)",
    kind="cpu",
    driver="Mesa 22.3.6",
    vendor="llvmpipe",
    backend="Vulkan",
)
INTEGRATED = AdapterSummary(1, "Intel(R) UHD Graphics 620", "integrated", "", "0x8086", "Vulkan")
VIRTUAL = AdapterSummary(2, "Virtio-GPU Venus", "virtual", "venus", "0x1af4", "Vulkan")
CARD = AdapterSummary(3, "NVIDIA GeForce RTX 3060", "discrete", "550.54", "0x10de", "Vulkan")
TWIN_CARD = replace(CARD, index=4)
ALL = [LAVAPIPE, INTEGRATED, VIRTUAL, CARD, TWIN_CARD]

ORDER = "the order is discrete, integrated, virtual, unknown, cpu"
LISTED = """\
; the adapters are
  0: llvmpipe (LLVM 15.0.6, 256 bits) (cpu, Mesa 22.3.6)
  1: Intel(R) UHD Graphics 620 (integrated)
  2: Virtio-GPU Venus (virtual, venus)
  3: NVIDIA GeForce RTX 3060 (discrete, 550.54)
  4: NVIDIA GeForce RTX 3060 (discrete, 550.54)"""


@pytest.mark.parametrize(
    ("adapters", "chosen", "reason"),
    [
        ([LAVAPIPE], LAVAPIPE, "the only adapter"),
        (ALL, CARD, f"the first of kind discrete; {ORDER}"),
        (ALL[:3], INTEGRATED, f"the first of kind integrated; {ORDER}"),
        ([LAVAPIPE, VIRTUAL], VIRTUAL, f"the first of kind virtual; {ORDER}"),
        ([LAVAPIPE, replace(CARD, kind="unknown")], replace(CARD, kind="unknown"),
         f"the first of kind unknown; {ORDER}"),
    ],
)  # fmt: skip
def test_the_best_kind_is_taken(
    adapters: list[AdapterSummary], chosen: AdapterSummary, reason: str
) -> None:
    assert select_adapter(adapters, None, {}) == (chosen, reason)


@pytest.mark.parametrize(
    ("requested", "environ", "chosen", "reason"),
    [
        (0, {}, LAVAPIPE, "adapter '0'"),
        ("4", {}, TWIN_CARD, "adapter '4'"),
        ("intel", {}, INTEGRATED, "adapter 'intel'"),
        ("rtx 3060", {}, CARD, "adapter 'rtx 3060', the first of 2 that match"),
        ("0", {"HALFSTEP_ADAPTER": "1"}, LAVAPIPE, "adapter '0'"),
        (None, {"HALFSTEP_ADAPTER": "LLVMPIPE"}, LAVAPIPE, "HALFSTEP_ADAPTER 'LLVMPIPE'"),
        (None, {"HALFSTEP_ADAPTER": "", "WGPUPY_WGPU_ADAPTER_NAME": "Intel"}, INTEGRATED,
         "WGPUPY_WGPU_ADAPTER_NAME 'Intel'"),
        (None, {"HALFSTEP_ADAPTER": "2", "WGPUPY_WGPU_ADAPTER_NAME": "Intel"}, VIRTUAL,
         "HALFSTEP_ADAPTER '2'"),
        (None, {"HALFSTEP_EXPECT_LAVAPIPE": "1"}, LAVAPIPE, "HALFSTEP_EXPECT_LAVAPIPE=1"),
        (None, {"HALFSTEP_EXPECT_LAVAPIPE": "True"}, LAVAPIPE, "HALFSTEP_EXPECT_LAVAPIPE=True"),
        (None, {"HALFSTEP_EXPECT_LAVAPIPE": " yes"}, LAVAPIPE, "HALFSTEP_EXPECT_LAVAPIPE= yes"),
        (None, {"HALFSTEP_EXPECT_LAVAPIPE": "FALSE"}, CARD, f"the first of kind discrete; {ORDER}"),
        (None, {"HALFSTEP_EXPECT_LAVAPIPE": "no"}, CARD, f"the first of kind discrete; {ORDER}"),
        (None, {"HALFSTEP_EXPECT_LAVAPIPE": ""}, CARD, f"the first of kind discrete; {ORDER}"),
        (None, {"HALFSTEP_EXPECT_LAVAPIPE": "0", "WGPU_BACKEND_TYPE": "Vulkan"}, CARD,
         f"the first of kind discrete; {ORDER}"),
    ],
)  # fmt: skip
def test_what_is_asked_for_is_taken(
    requested: str | int | None, environ: Mapping[str, str], chosen: AdapterSummary, reason: str
) -> None:
    assert select_adapter(ALL, requested, environ) == (chosen, reason)


@pytest.mark.parametrize(
    ("adapters", "requested", "environ", "message"),
    [
        (ALL, "radeon", {}, "adapter 'radeon': no such adapter" + LISTED),
        (ALL, 5, {}, "adapter '5': no such adapter" + LISTED),
        (ALL, -1, {}, "adapter '-1': no such adapter" + LISTED),
        (ALL, "3060", {}, "adapter '3060': no such adapter" + LISTED),
        (ALL, None, {"HALFSTEP_ADAPTER": "9"}, "HALFSTEP_ADAPTER '9': no such adapter" + LISTED),
        (ALL, None, {"WGPUPY_WGPU_ADAPTER_NAME": "intel"},
         "WGPUPY_WGPU_ADAPTER_NAME 'intel': no such adapter" + LISTED),
        (ALL, "RTX", {"HALFSTEP_EXPECT_LAVAPIPE": "1"},
         "adapter 'RTX': no such adapter; the adapters are\n"
         "  0: llvmpipe (LLVM 15.0.6, 256 bits) (cpu, Mesa 22.3.6)"),
        ([CARD], None, {"HALFSTEP_EXPECT_LAVAPIPE": "1"},
         "HALFSTEP_EXPECT_LAVAPIPE=1: no lavapipe; Mesa's driver brings it:\n"
         "  Debian, Ubuntu  sudo apt-get install mesa-vulkan-drivers\n"
         "  Fedora          sudo dnf install mesa-vulkan-drivers vulkan-loader\n"
         "  Arch            sudo pacman -S vulkan-swrast vulkan-icd-loader\n"
         "  conda           conda install -c conda-forge mesalib libvulkan-loader"),
        (ALL, None, {"HALFSTEP_EXPECT_LAVAPIPE": "lavapipe"},
         "HALFSTEP_EXPECT_LAVAPIPE=lavapipe: neither a yes (1, true, yes) nor a no "
         "(0, false, no, or nothing)"),
        (ALL, None, {"WGPU_BACKEND_TYPE": "OpenGL"},
         "WGPU_BACKEND_TYPE=OpenGL: Halfstep renders on Vulkan only"),
        ([], "RTX", {},
         "no Vulkan adapter found\nA graphics card needs its maker's driver; "
         "Mesa's needs no card:\n"
         "  Debian, Ubuntu  sudo apt-get install mesa-vulkan-drivers\n"
         "  Fedora          sudo dnf install mesa-vulkan-drivers vulkan-loader\n"
         "  Arch            sudo pacman -S vulkan-swrast vulkan-icd-loader\n"
         "  conda           conda install -c conda-forge mesalib libvulkan-loader\n"
         'Without a driver, the backend "numpy" renders the same picture slowly.'),
    ],
)  # fmt: skip
def test_what_is_not_there_is_said(
    adapters: list[AdapterSummary],
    requested: str | int | None,
    environ: Mapping[str, str],
    message: str,
) -> None:
    with pytest.raises(AdapterError) as caught:
        select_adapter(adapters, requested, environ)
    assert str(caught.value) == message
    assert caught.value.exit_code == 3


def test_the_adapter_of_this_machine_is_described(adapter: Adapter) -> None:
    report = device.describe()
    assert report["chosen"] == adapter.summary.index
    assert report["reason"] == adapter.reason
    assert [entry["index"] for entry in report["adapters"]] == list(range(len(report["adapters"])))
    assert {entry["backend"] for entry in report["adapters"]} == {"Vulkan"}


def test_swiftshader_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info: Info = {
        "device": "SwiftShader Device (Subzero)",
        "adapter_type": "CPU",
        "vendor": "SwiftShader driver",
        "vendor_id": 0x1AE0,
        "description": "",
        "backend_type": "Vulkan",
    }
    summary = device._summary(0, info)
    assert (summary.kind, summary.driver) == ("cpu", "SwiftShader driver")
    assert not device.is_lavapipe(summary)
    # Its file is told where it lies and the driver is not loaded.
    here, absent = tmp_path / "here.json", tmp_path / "absent.json"
    here.touch()
    monkeypatch.setattr(device, "SWIFTSHADER_FILES", (str(absent), str(here)))
    for adapters, file in (([summary, LAVAPIPE], None), ([LAVAPIPE], str(here)), ([], str(here))):
        monkeypatch.setattr(device, "list_adapters", lambda adapters=adapters: adapters)
        monkeypatch.setattr(device, "_handles", lambda: [SimpleNamespace(features=frozenset())] * 2)
        monkeypatch.delenv("HALFSTEP_ADAPTER", raising=False)
        assert device.describe()["swiftshader"] == file
    here.unlink()
    assert device.describe()["swiftshader"] is None


def test_expecting_lavapipe_gives_lavapipe(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not any(map(device.is_lavapipe, device.list_adapters())):
        pytest.skip("no lavapipe here")
    monkeypatch.setenv("HALFSTEP_EXPECT_LAVAPIPE", "1")
    assert device.is_lavapipe(device.choose_adapter().summary)
    assert adapter.summary in device.list_adapters()


def test_a_device_has_the_limits_of_its_adapter(adapter: Adapter) -> None:
    opened = open_device(adapter)
    for limit in ("max-buffer-size", "max-storage-buffer-binding-size"):
        assert opened.limits[limit] == adapter.handle.limits[limit]
    assert opened.features == {"timestamp-query"} & adapter.handle.features


def test_a_missing_feature_names_the_adapter_and_the_others(adapter: Adapter) -> None:
    class Poor:
        features = frozenset({"timestamp-query"})

    with pytest.raises(AdapterError) as caught:
        open_device(replace(adapter, handle=cast(GpuAdapter, Poor())), features={"shader-int64"})
    others = "".join(f"\n  {summary}" for summary in device.list_adapters())
    assert str(caught.value) == (
        f"adapter {adapter.summary} has no shader-int64 (64-bit integers in shaders); "
        f"the adapters are{others}"
    )


def test_a_lost_device_is_a_device_error(adapter: Adapter) -> None:
    import wgpu

    opened = open_device(adapter)
    opened.destroy()
    with pytest.raises(DeviceError) as caught, device_errors(adapter):
        opened.create_buffer(size=16, usage=wgpu.BufferUsage.STORAGE)
    assert str(caught.value).startswith(f"adapter {adapter.summary}: ")
    assert "Parent device is lost" in str(caught.value)
    assert caught.value.exit_code == 4


def test_too_large_a_buffer_is_a_device_error(adapter: Adapter) -> None:
    import wgpu

    opened = open_device(adapter)
    with pytest.raises(DeviceError) as caught, device_errors(adapter):
        opened.create_buffer(size=2**48, usage=wgpu.BufferUsage.STORAGE)
    assert f"Buffer size {2**48} is greater than the maximum buffer size" in str(caught.value)


def test_other_errors_pass_through(adapter: Adapter) -> None:
    with pytest.raises(ZeroDivisionError), device_errors(adapter):
        _ = 1 // 0


@pytest.mark.parametrize("runtime_directory", [None, "/run/user/1000"])
def test_listing_adapters_prints_nothing(runtime_directory: str | None) -> None:
    environ = {name: value for name, value in os.environ.items() if name != "XDG_RUNTIME_DIR"}
    if runtime_directory is not None:
        environ["XDG_RUNTIME_DIR"] = runtime_directory
    script = (
        "import os; from halfstep.device.adapters import list_adapters; list_adapters(); "
        "print(os.environ.get('XDG_RUNTIME_DIR'))"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], env=environ, capture_output=True, text=True, check=True
    )
    assert (result.stdout, result.stderr) == (f"{runtime_directory}\n", "")
