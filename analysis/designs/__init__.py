"""Numbers of sensor designs: what they cover, how they cluster, how they differ from random."""
