"""The simulated fingertip in stiff and extreme cases."""
