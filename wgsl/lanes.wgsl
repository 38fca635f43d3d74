// Four neighbouring pixels of a row travel together, one in each lane of a vec4.

alias f4 = vec4<f32>;
alias i4 = vec4<i32>;
alias u4 = vec4<u32>;
alias b4 = vec4<bool>;
