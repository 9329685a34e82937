"""Other papers' metrics, each under its own name: their numbers are never mixed with ours."""
