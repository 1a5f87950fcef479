"""Robots: outline, drive and sensors."""
