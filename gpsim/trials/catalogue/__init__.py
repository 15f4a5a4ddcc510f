"""The catalogue's laws and how strong they are drawn, written a second time and never shared with `gpsim.effects`."""
