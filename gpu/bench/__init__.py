"""`halfstep bench`: its measurements, its scenes, and the programs that it compares with."""
