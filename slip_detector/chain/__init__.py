"""The algorithm (the paper's Section 2): filters, kernel, votes, and the stamps of its rows."""
