"""SDF worlds: our own reader, which drops nothing in silence."""
