// How film looks: grain, a vignette, and a light meter.
override GRAIN: f32;

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var between: sampler;
@group(0) @binding(2) var developed: texture_storage_2d<rgba32float, write>;
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;

// A number of 0…1 from a seed, which goes on.
fn speck(seed: ptr<function, u32>) -> f32 {
  *seed = hash(*seed);
  return f32(*seed >> 8u) / 16777216.0;
}

fn grained(light: f32, seed: u32) -> f32 {
  var seed_ = seed;
  return light + GRAIN * (speck(&seed_) - 0.5);
}

fn dimmed(light: f32, at: vec2<f32>) -> f32 {
#ifdef ROUND
  return light * max(1.0 - dot(at, at), 0.0);
#else
  return light;
#endif
}

@fragment
fn vignette(@location(0) uv: vec2<f32>) -> @location(0) vec4<f32> {
  let color = textureSample(picture, between, uv);
  let at = uv - 0.5;
  return vec4<f32>(dimmed(color.r, at), dimmed(color.g, at), dimmed(color.b, at), 1.0);
}

@compute @workgroup_size(8, 8)
fn develop(@builtin(global_invocation_id) id: vec3<u32>) {
  let size = textureDimensions(developed);
  if (any(id.xy >= size)) {
    return;
  }
  let uv = (vec2<f32>(id.xy) + 0.5) / vec2<f32>(size);
  textureStore(developed, id.xy, 2.0 * textureSampleLevel(picture, between, uv, 0.0));
}

@compute @workgroup_size(1)
fn measure(@builtin(global_invocation_id) id: vec3<u32>) {
  var sum = 0.0;
  for (var x = 0u; x < textureDimensions(picture).x; x++) {
    sum += textureLoad(picture, vec2<u32>(x, id.x), 0).g;
  }
  sums[id.x] = sum;
}

@compute @workgroup_size(1)
fn total() {
  for (var k = 1u; k < arrayLength(&sums); k++) {
    sums[0] += sums[k];
  }
}
