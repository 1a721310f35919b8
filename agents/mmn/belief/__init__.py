"""What MMN believes of the maze: a shown map as the prior, revised by what the body meets on its way."""
