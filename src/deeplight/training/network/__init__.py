"""The networks: the generator on MobileNetV2, the discriminator, ImageNet weights to start."""
