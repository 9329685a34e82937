"""Trivial baselines, one file per method. A model that does not beat them has learnt nothing."""
