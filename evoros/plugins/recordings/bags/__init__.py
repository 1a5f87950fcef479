"""Missions as rosbags: messages, the two bag formats, and a layout for Foxglove."""
