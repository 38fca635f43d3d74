"""Uses wgpu: lists adapters, opens a device, and runs kernels that test the driver."""
