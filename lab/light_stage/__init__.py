"""A virtual light stage: photographs of the spheres under single lights, with known truth."""
