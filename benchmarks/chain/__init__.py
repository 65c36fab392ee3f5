"""The chain: its speed against SciPy and NumPy, its error against 50 digits."""
