"""Every side effect: what is read from and written to disk. Nothing here is called by a stage."""
