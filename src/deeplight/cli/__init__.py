"""The command line: one module per verb, each with `Args` and `run`."""
