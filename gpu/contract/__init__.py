"""The agreement of host, shaders and twin: number formats, stages, and the records they share."""
