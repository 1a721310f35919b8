"""A page on which a person drives the episodes of an evaluation."""
