// Outputs of words -> their planes, in pairs of words.

// Stores the words of four pixels of a plane.
fn store(plane: u32, place: u32, words: u4) {
  planes[place + plane * frame.plane_quads] = whole(words);
}
