// Known operands -> answers that a driver must get right, and answers in which it has a choice.
//
// All operands come from a buffer, so that no compiler folds them.

struct Operands {
  v: vec4<f32>,
  w: vec4<f32>,
  a: f32,
  b: f32,
  c: f32,
  tiny: f32,
  i: i32,
  j: i32,
  shift: u32,
  count: u32,
}

struct Answers {
  dot: f32,
  product: f32,
  sum: f32,
  product_sum: f32,
  sum_of_three: f32,
  common_factor: f32,
  quotient: f32,
  root: f32,
  subnormal: f32,
  truncated: i32,
  whole_sum: i32,
  whole_product: i32,
  shifted_left: i32,
  shifted_right: i32,
  shifted_unsigned: u32,
  looped: u32,
}

@group(0) @binding(0) var<storage, read> operands: array<Operands>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answers>;

// A loop that continues, breaks and ends by numbers from a buffer.
fn looped(count: u32, seed: u32) -> u32 {
  var total = seed;
  for (var k = 0u; k < count; k++) {
    if (k & 3u) == 1u {
      continue;
    }
    if k == 50u {
      break;
    }
    total = total * 31u + k;
  }
  return total;
}

@compute @workgroup_size(64)
fn arithmetic(@builtin(global_invocation_id) id: vec3<u32>) {
  let x = operands[id.x];
  answers[id.x] = Answers(
    dot(x.v, x.w),
    x.a * x.b,
    x.a + x.c,
    x.a * x.b + x.c,
    (x.v.x * x.w.x + x.v.y * x.w.y) + x.c,
    x.a * x.b + x.a * x.c,
    x.c / x.b,
    sqrt(x.a),
    x.tiny * x.tiny,
    i32(x.c * 1000.0),
    x.i + x.j,
    x.i * x.j,
    x.i << x.shift,
    x.i >> x.shift,
    bitcast<u32>(x.i) >> x.shift,
    looped(x.count, bitcast<u32>(x.j)),
  );
}

@group(0) @binding(0) var<storage, read_write> places: array<u32>;

// Fills a buffer of any size; each word depends on its index.
@compute @workgroup_size(64)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
  if id.x < arrayLength(&places) {
    places[id.x] = (id.x + 1u) * 2654435761u;
  }
}

var<workgroup> memory: array<atomic<u32>, 64>;

// Leaves numbers that are not zero in the memory of every workgroup.
@compute @workgroup_size(64)
fn leave(
  @builtin(global_invocation_id) id: vec3<u32>,
  @builtin(local_invocation_index) ix: u32,
) {
  atomicStore(&memory[ix], places[id.x] + ix);
  workgroupBarrier();
  places[id.x] = atomicLoad(&memory[63u - ix]);
}

// Adds one to the content of the workgroup memory at the start.
@compute @workgroup_size(64)
fn count(
  @builtin(global_invocation_id) id: vec3<u32>,
  @builtin(local_invocation_index) ix: u32,
) {
  atomicAdd(&memory[ix], 1u);
  workgroupBarrier();
  places[id.x] = atomicLoad(&memory[63u - ix]);
}
