"""The report's figures: described as values, and drawn."""
