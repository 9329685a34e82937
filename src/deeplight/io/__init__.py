"""Files in and out: photos, HDR images, video. Every write is atomic."""
