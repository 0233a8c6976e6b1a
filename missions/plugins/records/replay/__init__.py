"""A recorded run once more: looked at, decided again, seen again."""
