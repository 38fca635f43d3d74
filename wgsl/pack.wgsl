// Bytes of four pixels -> words.

// Three bytes of a pixel, red, green and blue -> three words of four pixels.
fn packed_image(pixels: u4) -> vec3<u32> {
  return vec3<u32>(
    pixels.x | (pixels.y << 24u),
    (pixels.y >> 8u) | (pixels.z << 16u),
    (pixels.z >> 16u) | (pixels.w << 8u),
  );
}

// The tag of a pixel, the last byte of its surface number -> a word of four pixels.
fn packed_tags(surface: u4) -> u32 {
  let tags = (surface & u4(255u)) << u4(0u, 8u, 16u, 24u);
  return (tags.x | tags.y) | (tags.z | tags.w);
}
