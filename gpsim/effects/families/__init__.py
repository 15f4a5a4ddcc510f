"""The families of effects, one file each; whoever adds a file here has added a family (see `gpsim.effects.registry`)."""
