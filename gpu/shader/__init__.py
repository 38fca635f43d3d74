"""Text of the shaders: what they depend on, and what they are written from."""
