"""The hands: the Celery app, its thin tasks, and the stages they run."""
