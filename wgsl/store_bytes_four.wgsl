// Outputs of bytes of a block of four quads -> their part of the buffer, four words at once.

// Stores an image: three words a quad.
fn store_image(
  place: u32,
  image_0: vec3<u32>,
  image_1: vec3<u32>,
  image_2: vec3<u32>,
  image_3: vec3<u32>,
) {
  let first = (BYTES_IMAGE * frame.plane_quads + 3u * place) / 4u;
  pixels[first] = whole(vec4<u32>(image_0, image_1.x));
  pixels[first + 1u] = whole(vec4<u32>(image_1.yz, image_2.xy));
  pixels[first + 2u] = whole(vec4<u32>(image_2.z, image_3));
}

// Stores tags: one word a quad.
fn store_tag(place: u32, tag_0: u32, tag_1: u32, tag_2: u32, tag_3: u32) {
  let first = (BYTES_TAG * frame.plane_quads + place) / 4u;
  pixels[first] = whole(vec4<u32>(tag_0, tag_1, tag_2, tag_3));
}
