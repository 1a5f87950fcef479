"""One mission: from a design, a world and random draws to an outcome."""
