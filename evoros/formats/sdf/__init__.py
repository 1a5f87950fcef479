"""Reading and writing of SDF worlds."""
