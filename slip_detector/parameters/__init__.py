"""One field of a frozen dataclass is one parameter: the machinery and one file for each set."""
