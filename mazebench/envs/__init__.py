"""The navigation task for Gymnasium: one environment, or many of them on all cores."""
