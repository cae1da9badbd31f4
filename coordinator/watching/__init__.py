"""Watching jobs: what happened, how far they are, and what there is to say at the end."""
