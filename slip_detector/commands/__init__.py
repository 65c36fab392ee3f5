"""The command lines: their options, and what they print and write."""
