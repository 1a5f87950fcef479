"""A mission as a film: what is where, the pictures, their encoding."""
