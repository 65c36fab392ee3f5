"""The simulated fingertip: its error against run time, beside SciPy's integrators."""
