// Outputs of words -> their planes, in pairs of words.

// The words of four pixels of a plane.
fn stored(plane: u32, place: u32) -> u4 {
  let pairs = planes[place + plane * frame.plane_quads];
  let low = vec2<u32>(pairs);
  let high = vec2<u32>(pairs >> vec2<u32>(32u));
  return u4(low.x, high.x, low.y, high.y);
}

// Stores the words of four pixels of a plane.
fn store(plane: u32, place: u32, words: u4) {
  planes[place + plane * frame.plane_quads] = whole(words);
}
