"""Readers of other people's maps: pictures, photographs, line drawings, arrays, ROS maps."""
