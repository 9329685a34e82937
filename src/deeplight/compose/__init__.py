"""Objects put into a photo: global illumination under the photo's light, then composited.

`mesh` and `shapes` give objects, `ground` says where the camera and its floor are, `materials`
how surfaces reflect, `scene` and `trace` render with Mitsuba, `composite` puts the result into
the photo, `look` gives it the photo's blur and grain; `compose` does it all.
"""
