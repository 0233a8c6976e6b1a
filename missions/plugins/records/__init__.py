"""What has happened: how runs are recorded, replayed, reported and counted."""
