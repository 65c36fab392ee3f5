"""The search for parameters on labelled recordings, and the verdict on what was held out."""
