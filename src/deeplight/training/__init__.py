"""Training: networks, their losses, data loading, devices, the loop, presets."""
