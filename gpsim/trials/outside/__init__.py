"""Physics outside the catalogue: kinds that no family of `gpsim.effects` describes, and never will."""
