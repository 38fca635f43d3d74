"""What `halfstep bench` measures, on what scenes, and against what."""
