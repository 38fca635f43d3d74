// Words stored in pairs, as 64-bit integers.
//
// llvmpipe stores for one invocation after another, and tests its mask for each store.

// Four words as two of 64 bits. They pass a select that no compiler can prove idle: otherwise LLVM
// computes the words anew for each invocation.
fn whole(words: vec4<u32>) -> vec2<u64> {
  let low = vec2<u64>(words.xz) & vec2<u64>(0xFFFFFFFFlu);
  let wide = (vec2<u64>(words.yw) << vec2<u32>(32u)) | low;
  return select(wide, vec2<u64>(0lu), vec2<bool>(frame.plane_quads == 0u));
}
