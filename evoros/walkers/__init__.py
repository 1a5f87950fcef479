"""Moving obstacles: people who walk through a world, avoiding each other and the robots."""
