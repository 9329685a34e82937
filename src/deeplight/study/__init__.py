"""A perceptual study: pairs of pictures for people to judge, and what their answers say."""
