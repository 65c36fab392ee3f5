"""The algorithm (the paper's Section 2): filters, kernel and votes; and the stamps of its rows."""
