"""What host, shaders and twin agree on: number formats, and the records they share."""
