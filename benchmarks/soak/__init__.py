"""Drivers and detectors of a hand that run for long."""
