"""Records: the file is the generated one, and the device finds each member where NumPy puts it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from halfstep.contract import layout
from halfstep.contract.formats import FIXED32, FLOAT32, FLOAT32_EXACT, Format
from halfstep.contract.layout import FRAME, LIGHT, RECORDS, Record
from halfstep.device.adapters import Adapter, open_device
from halfstep.shader.library import stage

# WGSL types of coefficients and values.
TYPES = {
    FLOAT32: {"Coefficient": "f32", "Value": "f32", "Length": "f32"},
    FLOAT32_EXACT: {"Coefficient": "i64", "Value": "f32", "Length": "f32"},
    FIXED32: {"Coefficient": "i64", "Value": "i32", "Length": "i64"},
}
# Terms of a polynomial and numbers of a formula, as the records here have them.
TERMS, NUMBERS, CASTER_TERMS = 40, 8, 20
COUNTED = [
    record.counted(TERMS=TERMS, NUMBERS=NUMBERS, CASTER_TERMS=CASTER_TERMS) for record in RECORDS
]
# So many records that a wrong stride shows.
COUNT = 3


@pytest.fixture(scope="module")
def device(adapter: Adapter) -> Iterator[Any]:
    device = open_device(adapter, features=("shader-int64",))
    yield device
    device.destroy()


def test_the_file_is_the_generated_one() -> None:
    assert stage("layout") == layout.wgsl(), "run python -m halfstep.contract.layout"


def echo(record: Record, number_format: Format) -> tuple[str, int]:
    """A shader that copies the scalars of every member to 64-bit integers, and how many it copies.

    Frames and lights are uniforms in the renderer, the other records are not.
    """
    types, scalars = TYPES[number_format], []
    for field in record.fields:
        for k in range(int(field.count)):
            name = f"records[ix].{field.name}" + (f"[{k}]" if field.count != 1 else "")
            parts = [f"{name}.{axis}" for axis in "xyzw"] if field.type[:3] == "vec" else [name]
            type_ = types.get(field.type, field.type)
            if type_ == "i64":
                scalars += parts
            elif "f32" in type_:
                scalars += [f"i64(bitcast<i32>({part}))" for part in parts]
            else:
                scalars += [f"i64({part})" for part in parts]
    space, stored = "storage, read", f"array<{record.name}>"
    if record in (FRAME, LIGHT):
        space, stored = "uniform", f"array<{record.name}, {COUNT}>"
    copies = "".join(
        f"  found[{len(scalars)}u * ix + {k}u] = {s};\n" for k, s in enumerate(scalars)
    )
    return (
        f"{''.join(f'alias {name} = {type_};' for name, type_ in types.items())}\n"
        f"const TERMS: u32 = {TERMS}u;\nconst NUMBERS: u32 = {NUMBERS}u;\n"
        f"const CASTER_TERMS: u32 = {CASTER_TERMS}u;\n{stage('layout')}\n"
        f"@group(0) @binding(0) var<{space}> records: {stored};\n"
        "@group(0) @binding(1) var<storage, read_write> found: array<i64>;\n"
        "@compute @workgroup_size(1)\n"
        "fn copy(@builtin(global_invocation_id) id: vec3<u32>) {\n"
        f"  let ix = id.x;\n{copies}}}\n"
    ), len(scalars)


@pytest.mark.parametrize("number_format", TYPES, ids=lambda form: form.forms)
@pytest.mark.parametrize("record", COUNTED, ids=lambda record: record.name)
def test_the_device_finds_every_member(record: Record, number_format: Format, device: Any) -> None:
    dtype = record.dtype(number_format)
    # Every word another; as float32 they are normal numbers, which no device changes.
    words = np.arange(COUNT * dtype.itemsize // 4, dtype=np.uint32) + np.float32(1).view(np.uint32)
    expected = []
    for row in words.view(dtype):
        for field in record.fields:
            member = np.atleast_1d(row[field.name]).ravel()
            expected += (member.view(np.int32) if member.dtype.itemsize == 4 else member).tolist()

    code, scalars = echo(record, number_format)
    pipeline = device.create_compute_pipeline(
        layout="auto",
        compute={"module": device.create_shader_module(code=code), "entry_point": "copy"},
    )
    usage = "UNIFORM" if record in (FRAME, LIGHT) else "STORAGE"
    buffers = [
        device.create_buffer_with_data(data=words, usage=usage),
        device.create_buffer(size=8 * COUNT * scalars, usage="STORAGE|COPY_SRC"),
    ]
    entries = [{"binding": k, "resource": {"buffer": buffer}} for k, buffer in enumerate(buffers)]
    group = device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries)
    encoder = device.create_command_encoder()
    compute = encoder.begin_compute_pass()
    compute.set_pipeline(pipeline)
    compute.set_bind_group(0, group)
    compute.dispatch_workgroups(COUNT)
    compute.end()
    device.queue.submit([encoder.finish()])
    found = np.frombuffer(device.queue.read_buffer(buffers[1]), np.int64)
    assert found.tolist() == expected
