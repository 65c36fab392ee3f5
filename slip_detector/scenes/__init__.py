"""The simulated fingertip: one file for each part of a scene."""
