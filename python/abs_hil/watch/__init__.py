"""`abs_hil watch`: a running experiment in a terminal."""
