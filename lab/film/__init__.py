"""Films of the three-sphere rig as a phone would record them, with their ground truth.

`recipe` says what to film; `hand` moves the phone, `world` is the place and `scenery` its picture;
`rig`, `parts` and `reflections` are the spheres and what they show; `overlay` and `picture` put a
frame together; `clip` films one clip, `truth` writes what is true, `run` makes the set.
"""
