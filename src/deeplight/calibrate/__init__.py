"""A trained model brought to one's own phone, by clips of the three spheres filmed with it."""
