"""Comparing: rehearsed queries become the paper's tables, with controls and intervals."""
