"""Files that are written whole, folder locks, JSON and arrays."""
