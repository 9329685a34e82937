"""Pictures to judge by eye, after the paper's figures: each takes a report and gives 8-bit RGB."""
