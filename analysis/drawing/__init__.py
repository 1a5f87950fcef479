"""What several figures share: style, the robot from above, tables as pictures."""
