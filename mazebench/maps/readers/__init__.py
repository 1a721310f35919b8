"""Readers of other people's maps: pictures, line drawings, arrays, ROS maps."""
