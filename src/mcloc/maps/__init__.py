"""Maps: the occupancy grid, its free space, its files."""
