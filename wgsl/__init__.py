"""The shader text of Halfstep, one file per stage and per shared set of functions."""
