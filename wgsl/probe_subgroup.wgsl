// The number of invocations in the subgroup of each invocation of a workgroup.

@group(0) @binding(0) var<storage, read_write> found: array<u32>;

@compute @workgroup_size(128)
fn ask(@builtin(local_invocation_index) local: u32, @builtin(subgroup_size) size: u32) {
  found[local] = size;
}
