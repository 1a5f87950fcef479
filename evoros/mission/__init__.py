"""One mission of a design in a world, under random draws."""
