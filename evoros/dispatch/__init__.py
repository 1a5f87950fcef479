"""Distribution of missions to workers."""
