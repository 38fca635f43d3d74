// Outputs of bytes of a block -> their part of the buffer, word by word.

// Stores an image: three words a quad.
fn store_image(
  place: u32,
  // each quad
  image_0: vec3<u32>,
) {
  let first = BYTES_IMAGE * frame.plane_quads + 3u * place;
  // each quad
  {
    pixels[first + 3u * QUAD_0] = image_0.x;
    pixels[first + 3u * QUAD_0 + 1u] = image_0.y;
    pixels[first + 3u * QUAD_0 + 2u] = image_0.z;
  }
}

// Stores tags: one word a quad.
fn store_tag(
  place: u32,
  // each quad
  tag_0: u32,
) {
  let first = BYTES_TAG * frame.plane_quads + place;
  // each quad
  pixels[first + QUAD_0] = tag_0;
}
