// A vec4 holds the values of four neighbouring pixels of a row.

alias f4 = vec4<f32>;
alias i4 = vec4<i32>;
alias u4 = vec4<u32>;
alias b4 = vec4<bool>;
