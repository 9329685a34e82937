"""An environment in the files and orientations of other tools."""
