"""The report's figures: described as values, and drawn for print; charts.js draws the same values on the page."""
