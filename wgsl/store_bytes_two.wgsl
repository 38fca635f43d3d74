// Outputs of bytes of a block of two quads -> their part of the buffer, two words at once.

// Stores an image: three words a quad.
fn store_image(place: u32, image_0: vec3<u32>, image_1: vec3<u32>) {
  let first = (BYTES_IMAGE * frame.plane_quads + 3u * place) / 2u;
  let front = whole(vec4<u32>(image_0, image_1.x));
  let back = whole(vec4<u32>(image_1.yz, 0u, 0u));
  pixels[first] = front.x;
  pixels[first + 1u] = front.y;
  pixels[first + 2u] = back.x;
}

// Stores tags: one word a quad.
fn store_tag(place: u32, tag_0: u32, tag_1: u32) {
  let first = (BYTES_TAG * frame.plane_quads + place) / 2u;
  pixels[first] = whole(vec4<u32>(tag_0, tag_1, 0u, 0u)).x;
}
