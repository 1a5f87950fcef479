"""Missions as rosbags: their messages, the two formats, and a layout for Foxglove."""
