"""A simulated phone capture in real HDR panoramas: what the rig would film there.

A panorama is a place (`panorama`), a `Phone` films it (`phone`), a take is one clip (`take`),
and `run` cuts takes into the shards of a data set.
"""
