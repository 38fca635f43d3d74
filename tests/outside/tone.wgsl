// Linear light -> the level of an 8-bit sRGB picture.
fn level(light: f32) -> u32 {
  let low = 12.92 * light;
  let high = 1.055 * pow(light, 1.0 / 2.4) - 0.055;
  let encoded = select(high, low, light <= 0.0031308);
  return u32(255.0 * clamp(encoded, 0.0, 1.0) + 0.5);
}

@group(0) @binding(0) var<storage, read> lights: array<f32>;
@group(0) @binding(1) var<storage, read_write> counts: array<atomic<u32>, 256>;

// How many values have each level.
@compute @workgroup_size(64)
fn histogram(@builtin(global_invocation_id) id: vec3<u32>) {
  if id.x < arrayLength(&lights) {
    atomicAdd(&counts[level(lights[id.x])], 1u);
  }
}
