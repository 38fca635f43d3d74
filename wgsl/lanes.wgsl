// A vec4 holds the values of four neighbouring pixels of a row.

// A shader renders the pixels of a tile with the solids of the tile's lists; its entry point stands
// at the end. Around a solid, x and y count pixels from the middle of its rectangle, and u runs
// along a ray from -1 to 1, over the solid's own interval of depth. A quadric is
// F = A u² + G u + C <= 0, a half-space c + b u <= 0. A, G, C, c and b are polynomials in x and y.
//
// Code for the quads of a block is written once for each, with the quad's number at the end of
// names. A loop tests at the end of its body: llvmpipe runs others one round longer.
alias f4 = vec4<f32>;
alias i4 = vec4<i32>;
alias u4 = vec4<u32>;
alias b4 = vec4<bool>;
