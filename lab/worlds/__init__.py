"""Made-up places to film in: rooms and open ground under physical skies, as HDR panoramas."""
