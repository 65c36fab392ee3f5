"""Recordings read, evaluated, searched and reported; what tuning brings."""
