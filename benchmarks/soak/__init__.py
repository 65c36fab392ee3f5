"""Drivers and detectors as processes: for long, for many fingers, and against a bare relay."""
