"""Grounds on which gpsim and its peers are compared: each module offers GROUNDS."""
