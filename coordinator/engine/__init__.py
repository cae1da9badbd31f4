"""A broker and workers: brought along, or found where they are."""
