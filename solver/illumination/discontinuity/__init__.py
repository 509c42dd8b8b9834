"""Where irradiance or its derivatives jump, how much that shows, and which lines are meshed."""
