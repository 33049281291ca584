"""`abs_hil serve`: a scope in the browser for a running experiment, or for a recorded one (docs/serve.md)."""
