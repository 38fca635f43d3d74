// Rounds that a loop is asked for -> rounds that it ran.

@group(0) @binding(0) var<storage, read> asked: array<u32>;
@group(0) @binding(1) var<storage, read_write> ran: array<u32>;

// A workgroup has one invocation, so that on a software adapter no other one shares its vector.
@compute @workgroup_size(1)
fn count_rounds(@builtin(workgroup_id) group: vec3<u32>) {
  let rounds = asked[group.x];
  var count = 0u;
  // A sequence that no compiler knows in closed form, so that the loop must run.
  var state = rounds;
  loop {
    state ^= state << 13u;
    state ^= state >> 17u;
    state ^= state << 5u;
    count++;
    if count >= rounds {
      break;
    }
  }
  ran[2u * group.x] = count;
  ran[2u * group.x + 1u] = state;
}
