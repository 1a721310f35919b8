"""The navigation task for Gymnasium: one environment, or many on all cores."""
