"""Trained networks and estimated light in the formats of others."""
