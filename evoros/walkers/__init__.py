"""Moving obstacles: people who walk through a world, around each other and the robots."""
