"""Subnormal numbers flushed to zero by this very processor, as some drivers let it do."""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

# In glibc's fenv_t of x86-64, the register of vector arithmetic and its bits that take subnormal
# operands, and results, for zero.
_WORD, _FLUSH = 7, 0x8040


@contextmanager
def flushing() -> Iterator[None]:
    """Flush subnormal numbers in this thread; skip the test if this machine has no known way."""
    if (platform.machine(), platform.libc_ver()[0]) != ("x86_64", "glibc"):
        pytest.skip("only on x86-64 with glibc it is known how to flush subnormal numbers")
    library = ctypes.CDLL("libm.so.6")
    before, now = ((ctypes.c_uint32 * 64)() for _ in range(2))
    for environment in (before, now):
        assert library.fegetenv(environment) == 0
    now[_WORD] |= _FLUSH
    assert library.fesetenv(now) == 0
    try:
        yield
    finally:
        assert library.fesetenv(before) == 0
