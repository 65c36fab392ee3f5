"""How fast and how exact the package is: measurements, rivals and references, not installed."""
