"""Loops that a driver ends early, seen from a loop that follows them.

lavapipe of Mesa 22.3 grants an invocation and its neighbours 65,535 rounds of all their loops.
Then it ends each loop after its first round (``device.probe.loop_limit``). So a loop of two rounds
is put after all others. If it gets only one round, the others may have been cut short.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.compute import Bound
from halfstep.testing.module import Module
from halfstep.testing.tokens import written

# The buffer of `watch` before the run: the rounds of the loop, and 0 for "nothing was cut".
WATCHED = np.array([2, 0], np.uint32)


def has_loop(module: Module, function: str) -> bool:
    """Whether a function, or one that it calls, has a loop."""
    reached = {function, *module.reached(function)} & module.declared.keys()
    return any(module.declared[name].has_loop for name in reached)


def watch(module: Module, number: int) -> str:
    """A function that notes whether loops before its call may have been cut short.

    ``number`` is the binding number of `WATCHED` in group 0. The function sets its second word to 1
    if so.
    """
    own = module.prefix
    return (
        f"@group(0) @binding({number}) var<storage, read_write> {own}watched: array<u32, 2>;\n"
        f"fn {own}watch() {{\n"
        f"  var {own}round = 0u;\n"
        "  loop {\n"
        f"    {own}round++;\n"
        f"    if ({own}round >= {own}watched[0]) {{\n      break;\n    }}\n"
        "  }\n"
        f"  if ({own}round < {own}watched[0]) {{\n    {own}watched[1] = 1u;\n  }}\n"
        "}\n"
    )


def calls(module: Module, entry_point: str) -> list[tuple[int, str]]:
    """The positions where an entry point ends, and the call of `watch` to insert at each.

    A value that it returns passes through a function that calls `watch`.
    """
    own, declaration = module.prefix, module.declared[entry_point]
    found = [(end.at, f"{own}watch(); ") for end in declaration.ends]
    for word, end in declaration.returns:
        found += [(word.end, f" {own}watched_first("), (end.at, ")")]
    if declaration.returns:
        type_ = written(declaration.type)
        text = f"fn {own}watched_first({own}value: {type_}) -> {type_} {{\n"
        text += f"  {own}watch();\n  return {own}value;\n}}\n"
        found.append((len(module.text), f"\n{text}"))
    return found


def bound(number: int) -> Bound:
    """The buffer that `watch` writes to, at a binding number in group 0."""
    return Bound(0, number, "storage", WATCHED.view(np.uint8))


def was_cut(watched: Bytes) -> bool:
    """Whether the bytes of the buffer after the run say that loops may have been cut short."""
    return bool(watched.view(np.uint32)[1])
