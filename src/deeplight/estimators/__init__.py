"""A photo in, the light of its scene out: the protocol, the network, results on disk."""
