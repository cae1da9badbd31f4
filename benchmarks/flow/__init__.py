"""What following costs: empty tasks through Celery, and a million orders without a broker."""
