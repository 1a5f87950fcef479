"""Robots: their outline, their drive and the sensors they carry."""
