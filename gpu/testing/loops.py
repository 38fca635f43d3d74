"""Loops that a driver ends early, seen from a loop that follows them.

lavapipe of Mesa 22.3 grants an invocation and its neighbours 65,535 rounds of all their loops, then
ends each after its first (``device.probe.loop_limit``). So where a loop of two rounds, after all
others, has only one, the others may have been cut short.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.compute import Bound
from halfstep.testing.module import Module
from halfstep.testing.tokens import written

# What the buffer of `watch` holds before: the rounds of the loop, and that nothing was cut.
WATCHED = np.array([2, 0], np.uint32)


def has_loop(module: Module, function: str) -> bool:
    """Whether a function, or one that it calls, has a loop."""
    reached = {function, *module.reached(function)} & module.declared.keys()
    return any(module.declared[name].has_loop for name in reached)


def watch(module: Module, number: int) -> str:
    """A function that looks whether loops before its call may have been cut short.

    ``number`` is where `WATCHED` is bound in group 0; its second word is then 1.
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
    """Where an entry point ends, and the call of `watch` to be put before it.

    What it returns goes through a function that watches, after all else that it does.
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
    """What `watch` writes to, at a number in group 0."""
    return Bound(0, number, "storage", WATCHED.view(np.uint8))


def was_cut(watched: Bytes) -> bool:
    """What the bytes of the buffer say afterwards."""
    return bool(watched.view(np.uint32)[1])
