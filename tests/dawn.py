"""A plugin of pytest by which tests run on Dawn, the WebGPU of Chrome: `make test-dawn`.

Its compiler is Tint. The package wgpudawn has the names and calls of wgpu, and takes its place for
a process.
"""

import wgpudawn

wgpudawn.install_as_wgpu()
