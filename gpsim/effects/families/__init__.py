"""The families of effects, site by site: a class that is added here is a family that is asked."""
