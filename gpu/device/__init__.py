"""wgpu: adapters, a device, and kernels that tell what a driver does."""
