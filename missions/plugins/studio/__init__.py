"""The studio: a page in the browser to see, start, drive and stop robots, and the socket by which a run is reached."""
