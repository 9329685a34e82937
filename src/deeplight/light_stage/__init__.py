"""From one-light-at-a-time photographs of the spheres to their reflectance bases."""
