"""Files that are written whole, JSON and arrays."""
