"""Published methods without usable public code, written anew from their papers, one file each.

They learn from panoramas, which our own training never sees: `crops` makes their pairs.
"""
