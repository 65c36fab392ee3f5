"""Recordings run through the chain: slips matched with alarms, scores, the paper's protocol."""
