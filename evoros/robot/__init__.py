"""Robots: their outline, their drive and their sensors."""
