"""Sound that several devices share: WAV files, and printed words."""
