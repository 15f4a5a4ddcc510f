"""The families of effects, one file each: a file that is added here is a family that is asked."""
