"""The search for parameters, the verdict on held-out recordings, and what rest and knocks tell."""
