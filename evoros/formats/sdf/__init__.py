"""SDF worlds: reads and writes them."""
