// Outputs of words -> their planes.

// The words of four pixels of a plane.
fn stored(plane: u32, place: u32) -> u4 {
  return planes[place + plane * frame.plane_quads];
}

// Stores the words of four pixels of a plane.
fn store(plane: u32, place: u32, words: u4) {
  planes[place + plane * frame.plane_quads] = words;
}
