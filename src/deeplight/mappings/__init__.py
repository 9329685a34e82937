"""Pictures of all directions: pixel <-> direction and solid angle, one file per mapping.

`resample` and `layouts` bring light from one to another.
"""
