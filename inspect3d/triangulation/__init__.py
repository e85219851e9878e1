"""From photographs to points: tied features, cameras where they are unknown, patches that fit all pictures."""
