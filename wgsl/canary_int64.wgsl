// The answers of canary.wgsl for 64-bit integers, which not every device has.

struct Operands {
  i: i64,
  j: i64,
  word: u32,
  shift: u32,
}

struct Answers {
  sum: i64,
  product: i64,
  shifted_left: i64,
  shifted_right: i64,
  from_signed: i64,
  from_unsigned: i64,
  less: u32,
  rounded: f32,
}

@group(0) @binding(0) var<storage, read> operands: array<Operands>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answers>;

@compute @workgroup_size(64)
fn arithmetic(@builtin(global_invocation_id) id: vec3<u32>) {
  let x = operands[id.x];
  answers[id.x] = Answers(
    x.i + x.j,
    x.i * x.j,
    x.i << x.shift,
    x.i >> x.shift,
    i64(bitcast<i32>(x.word)),
    i64(x.word),
    select(0u, 1u, x.i < x.j),
    f32(x.i),
  );
}
