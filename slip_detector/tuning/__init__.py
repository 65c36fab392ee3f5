"""The search for parameters on labelled recordings, and the verdict on held-out recordings."""
