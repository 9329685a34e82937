"""Many views of one place, one light: `fuse` for what was filmed, `Session` for what is being."""
