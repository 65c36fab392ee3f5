"""Drivers and detectors as processes: over a long time, for many fingers, against a bare relay."""
